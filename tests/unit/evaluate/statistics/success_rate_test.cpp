// SPDX-License-Identifier: Apache-2.0
#include "evaluate/statistics/success_rate.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "base/hash_random.h"

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
  constexpr double kMirrorRounding = 1e-14;
  EXPECT_NEAR(a.low, 1.0 - b.high, kMirrorRounding);
  EXPECT_NEAR(a.high, 1.0 - b.low, kMirrorRounding);
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

TEST(CumulativeCaptureRange, IsTheLargestErrorWithEnoughSuccessBelowIt) {
  // Twenty starts 1 ... 20 mm, of which the 15th fails: 14 of 14, 14 of 15, ... 19 of 20.
  std::vector<TreOutcome> outcomes;
  for (int i = 1; i <= 20; ++i) outcomes.push_back({static_cast<double>(i), i == 15 ? 9.0 : 0.1});
  const std::optional<CumulativeCaptureRange> range = cumulative_capture_range(outcomes);
  ASSERT_TRUE(range.has_value());
  EXPECT_EQ(range->initial_tre_mm, 20.0);  // 19 of 20 are 95 %
  EXPECT_TRUE(range->is_whole_study);
  EXPECT_EQ(cumulative_capture_range(std::span(outcomes).first(19))->initial_tre_mm, 14.0);
  EXPECT_FALSE(cumulative_capture_range(std::span(outcomes).first(19))->is_whole_study);
  EXPECT_EQ(cumulative_capture_range(outcomes, 1.0)->initial_tre_mm, 14.0);
}

TEST(CumulativeCaptureRange, CountsFailuresWithoutAPoseAndTakesEqualErrorsTogether) {
  const std::vector<TreOutcome> outcomes = {{1, 0.1}, {2, 0.1}, {2, std::nan("")}};
  EXPECT_EQ(cumulative_capture_range(outcomes)->initial_tre_mm, 1.0);
  EXPECT_EQ(cumulative_capture_range(outcomes)->starts, 1);
  EXPECT_FALSE(cumulative_capture_range(std::vector<TreOutcome>{{1, 9.0}}).has_value());
  EXPECT_FALSE(cumulative_capture_range({}).has_value());
}

/// Intervals of 2 mm, each with `starts` starts; `successes` says how many of them succeed.
std::vector<IntervalSuccess> intervals_with(const std::vector<int>& successes, int starts = 20) {
  std::vector<IntervalSuccess> intervals;
  for (std::size_t k = 0; k < successes.size(); ++k) {
    IntervalSuccess& interval = intervals.emplace_back();
    interval.low_mm = 2.0 * static_cast<double>(k);
    interval.high_mm = interval.low_mm + 2.0;
    interval.trials = starts;
    interval.successes = successes[k];
  }
  return intervals;
}

TEST(CaptureRange, EndsAtTheFirstIntervalWithTooManyFailures) {
  // 19 of 20 are 95 %; 18 end the range, whatever follows.
  const CaptureRange range = capture_range(intervals_with({20, 19, 20, 18, 20, 20}));
  EXPECT_EQ(range.initial_tre_mm, 6.0);
  EXPECT_EQ(range.starts, 60);
  EXPECT_EQ(range.successes, 59);
  EXPECT_EQ(range.end, CaptureEnd::Failures);
  EXPECT_EQ(range.end_interval, 3u);
  EXPECT_FALSE(range.is_whole_study());
  // The numbers that the paper's experiments had with 120 starts each: 92 % at 10-12 mm end it,
  // while 95.0 % of all starts up to 15.1 mm succeeded.
  EXPECT_EQ(
      capture_range(intervals_with({120, 120, 120, 119, 115, 110, 102, 96}, 120)).initial_tre_mm,
      10.0);
}

TEST(CaptureRange, SaysWhetherTheStudyEndsFirst) {
  const CaptureRange whole = capture_range(intervals_with({20, 20}));
  EXPECT_EQ(whole.initial_tre_mm, 4.0);
  EXPECT_EQ(whole.end, CaptureEnd::LastInterval);
  EXPECT_EQ(whole.end_interval, 2u);
  EXPECT_TRUE(whole.is_whole_study());
  auto intervals = intervals_with({20, 20, 20});
  intervals[1].trials = intervals[1].successes = 0;
  const CaptureRange hole = capture_range(intervals);
  EXPECT_EQ(hole.initial_tre_mm, 2.0);
  EXPECT_EQ(hole.end, CaptureEnd::NoStarts);
  EXPECT_TRUE(hole.is_whole_study());
  const CaptureRange none = capture_range(intervals_with({18, 20}));
  EXPECT_EQ(none.initial_tre_mm, 0.0);
  EXPECT_EQ(none.starts, 0);
  EXPECT_FALSE(none.is_whole_study());
  EXPECT_EQ(capture_range({}).initial_tre_mm, 0.0);
}

TEST(CaptureRange, IsNeverFartherThanTheCumulativeOne) {
  // Both ranges come from the same random outcomes. A rate that every interval reaches, all of them
  // together reach.
  for (std::uint64_t study = 0; study < 200; ++study) {
    HashRandom random(7, study);
    std::vector<TreOutcome> outcomes;
    for (int start = 0; start < 160; ++start) {
      const double initial_mm = random.uniform(0.0, 16.0);
      const bool fails = random.uniform() < 0.004 * initial_mm;
      outcomes.push_back({initial_mm, fails ? 9.0 : 0.1});
    }
    const CaptureRange range = capture_range(success_per_interval(outcomes, 8, 2.0));
    const auto cumulative = cumulative_capture_range(outcomes);
    double farthest_inside_mm = 0.0;
    for (const TreOutcome& outcome : outcomes)
      if (outcome.initial_tre_mm < range.initial_tre_mm)
        farthest_inside_mm = std::max(farthest_inside_mm, outcome.initial_tre_mm);
    EXPECT_GE(cumulative.has_value() ? cumulative->initial_tre_mm : 0.0, farthest_inside_mm)
        << study;
  }
}

}  // namespace
}  // namespace af::evaluation
