// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "base/build_id.h"
#include "base/error.h"
#include "base/hash_random.h"
#include "base/joined.h"
#include "base/number_text.h"
#include "base/parsed_number.h"
#include "base/vector_width.h"
#include "ranks/progress_printer.h"

namespace af {
namespace {

/// `readelf --notes` is the oracle. GNU ld writes a SHA-1 hash, other linkers write fewer bytes.
TEST(BuildId, IsThatOfThisProgram) {
  EXPECT_GE(build_id().size(), 16u);
  EXPECT_EQ(build_id().find_first_not_of("0123456789abcdef"), std::string::npos);
  std::array<char, 256> line{};
  const std::unique_ptr<FILE, int (*)(FILE*)> notes(popen("readelf --notes /proc/$PPID/exe", "r"),
                                                    pclose);
  std::string text;
  while (fgets(line.data(), static_cast<int>(line.size()), notes.get()) != nullptr)
    text += line.data();
  EXPECT_NE(text.find("Build ID: " + build_id()), std::string::npos) << text;
}

TEST(HashRandom, DependsOnItsKeysAloneAndOnAllOfThem) {
  EXPECT_EQ(HashRandom(1, 2, 3).next_bits(), HashRandom(1, 2, 3).next_bits());
  const std::set<std::uint64_t> values{HashRandom(1, 2, 3).next_bits(),
                                       HashRandom(9, 2, 3).next_bits(),
                                       HashRandom(1, 9, 3).next_bits(),
                                       HashRandom(1, 2, 9).next_bits()};
  EXPECT_EQ(values.size(), 4u);
  EXPECT_NE(hash_name("skull-01"), hash_name("skull-02"));
}

TEST(HashRandom, UniformAndNormalHaveTheirMoments) {
  constexpr int kDraws = 200000;
  HashRandom random(7);
  double mean = 0.0;
  double normal_mean = 0.0;
  double normal_square = 0.0;
  std::array<int, 10> bins{};
  for (int i = 0; i < kDraws; ++i) {
    const double value = random.uniform();
    ASSERT_GE(value, 0.0);
    ASSERT_LT(value, 1.0);
    mean += value / kDraws;
    ++bins[static_cast<std::size_t>(value * 10.0)];
    const double normal = random.normal();
    normal_mean += normal / kDraws;
    normal_square += normal * normal / kDraws;
  }
  // Five standard errors: 0.289 / sqrt(n), sqrt(n p q) / n, 1 / sqrt(n) and sqrt(2 / n).
  const double root = std::sqrt(static_cast<double>(kDraws));
  EXPECT_NEAR(mean, 0.5, 5 * 0.289 / root);
  for (const int count : bins) EXPECT_NEAR(count, kDraws / 10.0, 5 * 0.3 * root);
  EXPECT_NEAR(normal_mean, 0.0, 5 / root);
  EXPECT_NEAR(normal_square, 1.0, 5 * std::sqrt(2.0) / root);
}

TEST(Error, NamesFileFieldValueAndConstraint) {
  const InputError error("roi_px", "[1, 2]", "must have four values", "study.toml");
  EXPECT_STREQ(error.what(), "study.toml: roi_px = [1, 2]: must have four values");
  EXPECT_EQ(error.exit_code(), ExitCode::Input);
  const FileError truncated("a.h5", "/field", "10 bytes", "7 bytes");
  EXPECT_STREQ(truncated.what(), "a.h5: /field: expected 10 bytes, found 7 bytes");
  EXPECT_EQ(truncated.exit_code(), ExitCode::File);
}

TEST(Error, ThrowIfAnyListsEveryProblem) {
  EXPECT_NO_THROW(throw_if_any({}));
  try {
    throw_if_any({"a is bad", "b is worse"}, "f.toml");
    FAIL();
  } catch (const InputError& error) {
    EXPECT_STREQ(error.what(), "f.toml: a is bad\n  f.toml: b is worse");
  }
}

TEST(VectorWidth, ForcedWidthIsUsedUntilReleased) {
  for (const VectorWidth width : supported_vector_widths()) {
    force_vector_width(width);
    EXPECT_EQ(active_vector_width(), width);
  }
  force_vector_width(std::nullopt);
  EXPECT_EQ(supported_vector_widths().front(), VectorWidth::Bits128);
}

TEST(DurationText, ReadsLikeAPersonWouldSay) {
  EXPECT_EQ(duration_text(12.34), "12.3 s");
  EXPECT_EQ(duration_text(200), "3 min 20 s");
  EXPECT_EQ(duration_text(3900), "1 h 05 min");
  EXPECT_EQ(expected_time_text("poses compared", 99, 1.6, 2),
            "poses compared: 99, about 1 min 20 s on 2 ranks (1.6 s each)");
  EXPECT_EQ(expected_time_text("registrations", 10, 0.05, 1),
            "registrations: 10, about 0.5 s on 1 rank (50 ms each)");
}

TEST(Errors, QuoteNoMoreOfALongTextThanItsEnds) {
  constexpr std::size_t kLength = 50'000'000;
  const std::string cell = std::string(kLength, 'x') + "END";
  const std::string message = FileError("a.csv:3", "rx_deg", "a number", "'" + cell + "'").what();
  EXPECT_LT(message.size(), 2000u);
  EXPECT_TRUE(message.starts_with("a.csv:3: rx_deg: expected a number, found 'xxx")) << message;
  EXPECT_TRUE(message.ends_with("xEND'")) << message;
  EXPECT_NE(message.find(" bytes left out) "), std::string::npos) << message;
}

TEST(Errors, KeepMessagesOfManyLinesAndWholeCharacters) {
  std::vector<std::string> problems;
  for (int i = 0; i < 100; ++i) problems.push_back("problem " + std::to_string(i));
  const std::string all = [&] {
    try {
      throw_if_any(problems, std::string(30, 'f'));
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string();
  }();
  EXPECT_EQ(shortened(all), all);
  EXPECT_NE(all.find("problem 99"), std::string::npos);
  for (std::size_t shift = 0; shift < 3; ++shift) {
    std::string euros(shift, 'a');
    for (int i = 0; i < 1000; ++i) euros += "\xE2\x82\xAC";
    const std::string text = shortened(euros);
    const std::size_t gap = text.find(" ... ");
    ASSERT_NE(gap, std::string::npos);
    EXPECT_EQ((gap - shift) % 3, 0u);
    EXPECT_EQ(text.substr(text.find(") ... ") + 6).size() % 3, 0u);
  }
}

TEST(ParsedNumber, IsOneWholeNumberWithOneSignAtMost) {
  EXPECT_EQ(finite_number("5"), 5.0);
  EXPECT_EQ(finite_number("+5"), 5.0);
  EXPECT_EQ(finite_number("-0.5e-3"), -0.0005);
  EXPECT_EQ(finite_number(number_text(0.1)), 0.1);
  for (const char* const text :
       {"", "+", "-", "+-5", "-+5", "++5", " 5", "5 ", "5mm", "1,5", "0x5", "1e999"})
    EXPECT_FALSE(parsed_number(text).has_value()) << "'" << text << "'";
  EXPECT_EQ(parsed_number("-inf"), -std::numeric_limits<double>::infinity());
  EXPECT_FALSE(finite_number("-inf").has_value());
  EXPECT_FALSE(finite_number("nan").has_value());
}

TEST(Joined, KeepsASeparatorBesideEmptyParts) {
  using Words = std::vector<std::string>;
  EXPECT_EQ(joined(Words{}), "");
  EXPECT_EQ(joined(Words{"a"}), "a");
  EXPECT_EQ(joined(Words{"", "a", ""}, "|"), "|a|");
  EXPECT_EQ(joined(std::vector<int>{1, 2}, " x ", [](int i) { return std::to_string(i); }),
            "1 x 2");
}

}  // namespace
}  // namespace af
