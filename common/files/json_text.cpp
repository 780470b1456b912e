// SPDX-License-Identifier: Apache-2.0
#include "files/json_text.h"

#include "base/error.h"

namespace af {

namespace {

constexpr int kMaxDepth = 64;

template <typename Json>
Json parsed(const std::string& text, const std::string& file) {
  const auto is_not_deep = [&](int depth, typename Json::parse_event_t, const Json&) {
    if (depth > kMaxDepth)
      throw FileError(file, "nests deeper than " + std::to_string(kMaxDepth) + " levels");
    return true;
  };
  try {
    return Json::parse(text, is_not_deep);
  } catch (const nlohmann::json::exception& error) {
    throw FileError(file, std::string("is not JSON, or cut short: ") + error.what());
  }
}

}  // namespace

nlohmann::json json_of_text(const std::string& text, const std::string& file) {
  return parsed<nlohmann::json>(text, file);
}

nlohmann::ordered_json ordered_json_of_text(const std::string& text, const std::string& file) {
  return parsed<nlohmann::ordered_json>(text, file);
}

}  // namespace af
