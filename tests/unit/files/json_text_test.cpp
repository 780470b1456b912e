// SPDX-License-Identifier: Apache-2.0
#include "files/json_text.h"

#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/io_checks.h"

namespace af {
namespace {

std::string nested(std::size_t levels) {
  return std::string(levels, '[') + std::string(levels, ']');
}

TEST(JsonText, ReadsValuesAndKeepsTheOrderOfKeysWhereAsked) {
  EXPECT_EQ(json_of_text(R"({"b": [1, 2.5], "a": null})", "file").at("b").at(1), 2.5);
  EXPECT_EQ(ordered_json_of_text(R"({"b": 1, "a": 2})", "file").dump(), R"({"b":1,"a":2})");
}

TEST(JsonText, RefusesWhatIsNoJsonAndNamesTheFile) {
  for (const char* text : {"", "{", "{\"a\": 1,}", "[1, 2", "nan", "\"\xff\""})
    EXPECT_THAT(test::message_of<FileError>([&] { json_of_text(text, "a.json"); }),
                testing::HasSubstr("a.json: is not JSON"))
        << text;
}

TEST(JsonText, RefusesWhatIsNestedTooDeeply) {
  EXPECT_TRUE(json_of_text(nested(64), "file").is_array());
  // Deep enough to exhaust a stack of 8 MB, were every level a call.
  for (const std::size_t levels : {std::size_t{66}, std::size_t{1} << 20}) {
    EXPECT_THAT(test::message_of<FileError>([&] { json_of_text(nested(levels), "file"); }),
                testing::HasSubstr("deeper than 64"));
    EXPECT_NE(test::message_of<FileError>([&] { ordered_json_of_text(nested(levels), "file"); }),
              "");
  }
}

}  // namespace
}  // namespace af
