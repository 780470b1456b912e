// SPDX-License-Identifier: Apache-2.0
#include "base/interned_text.h"

#include <cstring>
#include <type_traits>

#include <gtest/gtest.h>

namespace af {
namespace {

static_assert(std::is_trivially_copyable_v<InternedText>);

TEST(InternedText, KeepsEqualTextsOnce) {
  const std::string longer(100, 'x');
  const InternedText one(longer);
  const InternedText other(std::string(100, 'x'));
  EXPECT_EQ(&one.text(), &other.text());
  EXPECT_EQ(one, other);
  EXPECT_NE(one, InternedText("x"));
  EXPECT_TRUE(one == longer);
  EXPECT_EQ(InternedText("").text(), "");
  EXPECT_EQ(InternedText(""), InternedText());
}

TEST(InternedText, IsEmptyWhenAllItsBytesAreZero) {
  InternedText text("something");
  std::memset(static_cast<void*>(&text), 0, sizeof text);
  EXPECT_EQ(text, InternedText());
  EXPECT_EQ(text.text(), "");
}

TEST(InternedText, IsOrderedLikeItsText) {
  const InternedText b("b");  // kept before a
  const InternedText a("a");
  EXPECT_LT(a, b);
  EXPECT_LT(InternedText(), a);
  EXPECT_FALSE(b < b);
}

}  // namespace
}  // namespace af
