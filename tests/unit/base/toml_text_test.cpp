// SPDX-License-Identifier: Apache-2.0
#include "base/toml_text.h"

#include <algorithm>
#include <string>

#include <gtest/gtest.h>

namespace af {
namespace {

TEST(TomlText, EscapesWhatABasicStringMustNotHold) {
  EXPECT_EQ(toml_text("plain: \xC3\xA4 \xE2\x82\xAC \xF0\x9F\xA6\xB4"),
            "\"plain: \xC3\xA4 \xE2\x82\xAC \xF0\x9F\xA6\xB4\"");
  EXPECT_EQ(toml_text("a\"b\\c"), R"("a\"b\\c")");
  EXPECT_EQ(toml_text("a\nb\tc\x1b\x7f"), R"("a\u000Ab\u0009c\u001B\u007F")");
}

TEST(TomlText, ReplacesBytesThatAreNotUtf8) {
  // A lone byte, a cut character, an overlong one, a surrogate, one beyond Unicode.
  EXPECT_EQ(toml_text("\xFF"), R"("\uFFFD")");
  EXPECT_EQ(toml_text("a\xE2\x82"), R"("a\uFFFD\uFFFD")");
  EXPECT_EQ(toml_text("\xC0\xAF"), R"("\uFFFD\uFFFD")");
  EXPECT_EQ(toml_text("\xED\xA0\x80"), R"("\uFFFD\uFFFD\uFFFD")");
  EXPECT_EQ(toml_text("\xF4\x90\x80\x80"), R"("\uFFFD\uFFFD\uFFFD\uFFFD")");
}

TEST(BeginningOf, CutsNoCharacterInTwo) {
  const std::string text = "a\xC3\xA4\xE2\x82\xAC\xF0\x9F\xA6\xB4z";
  const std::string expected[] = {"", "a", "a", "a\xC3\xA4"};
  for (std::size_t bytes = 0; bytes < 4; ++bytes)
    EXPECT_EQ(beginning_of(text, bytes), expected[bytes]) << bytes;
  for (std::size_t bytes = 0; bytes <= text.size() + 1; ++bytes) {
    EXPECT_TRUE(is_utf8(beginning_of(text, bytes))) << bytes;
    EXPECT_GE(beginning_of(text, bytes).size() + 3, std::min(bytes, text.size())) << bytes;
  }
  EXPECT_EQ(beginning_of(text, text.size()), text);
  // Bytes that form no character stay: a message shows them as they are.
  EXPECT_EQ(beginning_of("\x80\x81\x82\x83\x84", 4), "\x80\x81\x82\x83");
}

}  // namespace
}  // namespace af
