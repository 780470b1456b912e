// SPDX-License-Identifier: Apache-2.0
#include "evaluate/statistics/success_rate.h"

#include <cmath>

#include <gtest/gtest.h>

namespace af::evaluation {
namespace {

// Published values carry four decimals.
constexpr double kPublishedRounding = 5e-5;

TEST(WilsonInterval, EqualsPublishedValues) {
  // Newcombe, "Two-sided confidence intervals for the single proportion", Statistics in Medicine
  // 17 (1998), Table I, method 3 (score, no continuity correction).
  const struct {
    int successes, trials;
    double low, high;
  } published[] = {{81, 263, 0.2553, 0.3662},
                   {15, 148, 0.0624, 0.1605},
                   {0, 20, 0.0000, 0.1611},
                   {1, 29, 0.0061, 0.1718}};
  for (const auto& row : published) {
    const ProportionInterval interval = wilson_interval(row.successes, row.trials);
    EXPECT_NEAR(interval.low, row.low, kPublishedRounding) << row.trials;
    EXPECT_NEAR(interval.high, row.high, kPublishedRounding) << row.trials;
  }
}

TEST(WilsonInterval, IsSymmetricUnderSwappingSuccessAndFailure) {
  const ProportionInterval a = wilson_interval(3, 17);
  const ProportionInterval b = wilson_interval(14, 17);
  constexpr double kRounding = 1e-14;
  EXPECT_NEAR(a.low, 1.0 - b.high, kRounding);
  EXPECT_NEAR(a.high, 1.0 - b.low, kRounding);
}

TEST(WilsonInterval, EndsExactlyAtZeroAndOne) {
  EXPECT_EQ(wilson_interval(0, 30).low, 0.0);
  EXPECT_EQ(wilson_interval(30, 30).high, 1.0);
  EXPECT_EQ(wilson_interval(0, 0).low, 0.0);
  EXPECT_EQ(wilson_interval(0, 0).high, 1.0);
}

const std::vector<TreOutcome> kOutcomes = {{0.5, 0.3},
                                           {1.99, 2.5},  // exactly at the threshold: no success
                                           {2.0, 2.4999},
                                           {3.0, std::nan("")},
                                           {15.9, 8.0},
                                           {16.0, 0.1},  // beyond the last interval
                                           {-1.0, 0.1}};

TEST(SuccessRate, CountsPerIntervalWithFailuresInTheDenominator) {
  const auto intervals = success_per_interval(kOutcomes, 8, 2.0);
  ASSERT_EQ(intervals.size(), 8u);
  EXPECT_EQ(intervals[0].trials, 2);
  EXPECT_EQ(intervals[0].successes, 1);
  EXPECT_EQ(intervals[1].trials, 2);
  EXPECT_EQ(intervals[1].successes, 1);
  EXPECT_EQ(intervals[2].trials, 0);
  EXPECT_TRUE(std::isnan(intervals[2].rate()));
  EXPECT_EQ(intervals[7].trials, 1);
  EXPECT_EQ(intervals[7].successes, 0);
  EXPECT_EQ(intervals[7].low_mm, 14.0);
  EXPECT_EQ(intervals[7].high_mm, 16.0);
}

TEST(SuccessRate, NanIsNeverASuccess) {
  EXPECT_EQ(count_successes(kOutcomes, 2.5), 4);
  EXPECT_EQ(count_successes(kOutcomes, 1e9), 6);
}

TEST(CaptureRange, IsTheLargestErrorWithEnoughSuccessBelowIt) {
  // Twenty starts 1 ... 20 mm, of which the 15th fails: 14 of 14, 14 of 15, ... 19 of 20.
  std::vector<TreOutcome> outcomes;
  for (int i = 1; i <= 20; ++i) outcomes.push_back({static_cast<double>(i), i == 15 ? 9.0 : 0.1});
  const std::optional<CaptureRange> range = capture_range(outcomes);
  ASSERT_TRUE(range.has_value());
  EXPECT_EQ(range->initial_tre_mm, 20.0);  // 19 of 20 are 95 %
  EXPECT_TRUE(range->is_whole_study);
  EXPECT_EQ(capture_range(std::span(outcomes).first(19))->initial_tre_mm, 14.0);
  EXPECT_FALSE(capture_range(std::span(outcomes).first(19))->is_whole_study);
  EXPECT_EQ(capture_range(outcomes, 1.0)->initial_tre_mm, 14.0);
}

TEST(CaptureRange, CountsFailuresWithoutAPoseAndTakesEqualErrorsTogether) {
  const std::vector<TreOutcome> outcomes = {{1, 0.1}, {2, 0.1}, {2, std::nan("")}};
  EXPECT_EQ(capture_range(outcomes)->initial_tre_mm, 1.0);
  EXPECT_EQ(capture_range(outcomes)->starts, 1);
  EXPECT_FALSE(capture_range(std::vector<TreOutcome>{{1, 9.0}}).has_value());
  EXPECT_FALSE(capture_range({}).has_value());
}

}  // namespace
}  // namespace af::evaluation
