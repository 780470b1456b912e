// SPDX-License-Identifier: Apache-2.0
#include "text/cbor_json.h"

#include <cstdint>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "support/io_checks.h"

namespace af {
namespace {

using nlohmann::json;
using Bytes = std::vector<std::uint8_t>;

json read(const Bytes& bytes) {
  return json_of_cbor(std::as_bytes(std::span(bytes)), "journal");
}

TEST(CborJson, ReadsWhatTheLibraryWrites) {
  const json value = {1, -2, 3.5, "text", nullptr, true, {{"key", {1, 2}}}, json::binary({1, 2})};
  EXPECT_EQ(read(json::to_cbor(value)), value);
}

TEST(CborJson, RefusesWhatIsNestedTooDeeply) {
  constexpr std::uint8_t kArrayOfOne = 0x81;
  Bytes deepest(16, kArrayOfOne);
  deepest.push_back(0);
  EXPECT_TRUE(read(deepest).is_array());
  // Deep enough to exhaust a stack of 8 MB, were every level a call.
  for (const std::size_t levels : {std::size_t{17}, std::size_t{10} << 20})
    EXPECT_NE(test::message_of<FileError>([&] { read(Bytes(levels, kArrayOfOne)); }), "");
}

TEST(CborJson, RefusesHugeCountsWithoutAskingForMemory) {
  for (const std::uint8_t kind : Bytes{0x9b, 0xbb, 0x5b, 0x7b})  // arrays, maps, bytes, texts
    EXPECT_NE(test::message_of<FileError>([&] {
                read({kind, 0x00, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff});
              }),
              "");
  EXPECT_NE(test::message_of<FileError>([] { read({}); }), "");
}

}  // namespace
}  // namespace af
