// SPDX-License-Identifier: Apache-2.0
#include "text/cbor_json.h"

#include <cstdint>

#include "base/error.h"

namespace af {

using nlohmann::json;

namespace {

/// Counts levels; false ends the reading.
class DepthCheck : public nlohmann::json_sax<json> {
 public:
  bool null() override { return true; }
  bool boolean(bool) override { return true; }
  bool number_integer(json::number_integer_t) override { return true; }
  bool number_unsigned(json::number_unsigned_t) override { return true; }
  bool number_float(json::number_float_t, const std::string&) override { return true; }
  bool string(std::string&) override { return true; }
  bool binary(json::binary_t&) override { return true; }
  bool key(std::string&) override { return true; }
  bool start_object(std::size_t) override { return ++depth_ <= kMaxDepth; }
  bool start_array(std::size_t) override { return ++depth_ <= kMaxDepth; }
  bool end_object() override { return leave(); }
  bool end_array() override { return leave(); }
  bool parse_error(std::size_t, const std::string&, const json::exception&) override {
    return false;
  }

 private:
  static constexpr int kMaxDepth = 16;
  bool leave() {
    --depth_;
    return true;
  }
  int depth_ = 0;
};

}  // namespace

std::vector<std::byte> cbor_bytes(const json& value) {
  const std::vector<std::uint8_t> packed = json::to_cbor(value);
  const auto bytes = std::as_bytes(std::span(packed));
  return {bytes.begin(), bytes.end()};
}

json json_of_cbor(std::span<const std::byte> bytes, const std::string& file) {
  const auto* const first = reinterpret_cast<const std::uint8_t*>(bytes.data());
  const auto* const last = first + bytes.size();
  DepthCheck depth;
  if (!json::sax_parse(first, last, &depth, json::input_format_t::cbor))
    throw FileError(file, "a record is not CBOR, or nested too deeply");
  return json::from_cbor(first, last);
}

}  // namespace af
