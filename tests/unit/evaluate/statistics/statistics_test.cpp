// SPDX-License-Identifier: Apache-2.0
#include "evaluate/statistics/statistics.h"

#include <cmath>
#include <limits>
#include <utility>

#include <gtest/gtest.h>

#include "base/error.h"
#include "base/hash_random.h"

namespace af::evaluation {
namespace {

constexpr double kRounding = 1e-12;

TEST(Quantile, InterpolatesBetweenOrderStatistics) {
  const std::vector<double> values = {1, 2, 4, 8};
  EXPECT_EQ(quantile(values, 0.0), 1.0);
  EXPECT_EQ(quantile(values, 1.0), 8.0);
  EXPECT_NEAR(quantile(values, 0.5), 3.0, kRounding);
  EXPECT_NEAR(quantile(values, 0.25), 1.75, kRounding);  // position 0.75
  EXPECT_NEAR(quantile(values, 0.95), 7.4, kRounding);   // position 2.85
}

TEST(Quantile, ToleratesInfinityAtTheTop) {
  const double infinity = std::numeric_limits<double>::infinity();
  const std::vector<double> values = {40, 41, infinity, infinity};
  EXPECT_EQ(quantile(values, 1.0), infinity);
  EXPECT_EQ(quantile(values, 0.9), infinity);
  EXPECT_EQ(quantile(values, 1.0 / 3.0), 41.0);
}

TEST(Summary, OfAHandComputedSample) {
  const SampleSummary summary = summarize({9, 4, 2, 5, 5});
  EXPECT_EQ(summary.count, 5u);
  EXPECT_NEAR(summary.mean, 5.0, kRounding);
  EXPECT_NEAR(summary.standard_deviation, std::sqrt(26.0 / 4.0), kRounding);
  EXPECT_EQ(summary.minimum, 2.0);
  EXPECT_EQ(summary.lower_quartile, 4.0);
  EXPECT_EQ(summary.median, 5.0);
  EXPECT_EQ(summary.upper_quartile, 5.0);
  EXPECT_EQ(summary.maximum, 9.0);
}

TEST(Summary, RefusesNanAndSaysNanOfNothing) {
  EXPECT_THROW(summarize({1.0, std::nan("")}), InputError);
  EXPECT_EQ(summarize({}).count, 0u);
  EXPECT_TRUE(std::isnan(summarize({}).median));
  EXPECT_TRUE(std::isnan(summarize({1.0}).standard_deviation));
}

TEST(StudentInterval, EqualsStudentsSleepData) {
  // The differences of Student's data below; R: t.test() gives -2.4598858 to -0.7001142.
  const std::vector<double> differences = {
      -1.2, -2.4, -1.3, -1.3, 0.0, -1.0, -1.8, -0.8, -4.6, -1.4};
  const MeanInterval interval = student_interval(differences);
  EXPECT_NEAR(interval.low, -2.4598858, 5e-8);
  EXPECT_NEAR(interval.high, -0.7001142, 5e-8);
}

TEST(StudentInterval, DoesNotExistWithoutSpread) {
  EXPECT_TRUE(std::isnan(student_interval({}).low));
  EXPECT_TRUE(std::isnan(student_interval(std::vector<double>{0.9}).high));
  EXPECT_TRUE(std::isnan(student_interval(std::vector<double>{1.0, 1.0, 1.0}).low));
}

TEST(PairedComparison, EqualsStudentsSleepData) {
  // Student (1908), extra hours of sleep under two drugs; R: t.test(group1, group2, paired = TRUE)
  // gives t = -4.0621, df = 9, p = 0.002833, mean difference -1.58.
  const std::vector<double> first = {0.7, -1.6, -0.2, -1.2, -0.1, 3.4, 3.7, 0.8, 0.0, 2.0};
  const std::vector<double> second = {1.9, 0.8, 1.1, 0.1, -0.1, 4.4, 5.5, 1.6, 4.6, 3.4};
  const PairedComparison result = compare_paired(first, second, 3.0);
  EXPECT_EQ(result.pairs, 10u);
  EXPECT_NEAR(result.mean_difference, -1.58, kRounding);
  EXPECT_NEAR(result.mean_difference / result.standard_error, -4.0621, 5e-5);
  EXPECT_NEAR(result.t_test_p, 0.002833, 5e-7);
  // Two one-sided tests: the interval of 90 % lies within +-3, so p < 0.05, and the other way
  // round.
  EXPECT_LT(result.equivalence_p, 0.05);
  EXPECT_GT(result.low_90, -3.0);
  EXPECT_LT(result.high_90, 3.0);
  EXPECT_GT(compare_paired(first, second, 2.0).equivalence_p, 0.05);
  EXPECT_LT(result.low_90, -2.0);
}

TEST(PairedComparison, IsSignificantExactlyWhenEquivalenceIntervalAndPAgree) {
  // At margin = the far end of the 90 % interval, p of the two one-sided tests is 0.05.
  const std::vector<double> first = {1.0, 2.0, 3.5, 4.0, 5.5};
  const std::vector<double> second = {0.8, 2.3, 3.0, 4.1, 5.0};
  const double far_end = compare_paired(first, second, 1.0).high_90;
  EXPECT_NEAR(compare_paired(first, second, far_end).equivalence_p, 0.05, 1e-9);
}

TEST(EquivalencePower, EqualsTheShareOfSimulatedStudies) {
  // Studies of normal differences about zero: the share that shows equivalence is the power.
  constexpr std::uint64_t kStudies = 4000;
  for (const auto& [pairs, margin] : {std::pair<std::size_t, double>{12, 1.0}, {40, 0.5}}) {
    int shown = 0;
    for (std::uint64_t study = 0; study < kStudies; ++study) {
      HashRandom random(3, pairs, study);
      std::vector<double> first(pairs);
      for (double& value : first) value = random.normal();
      const PairedComparison result =
          compare_paired(first, std::vector<double>(pairs, 0.0), margin);
      shown += result.equivalence_p < 0.05 ? 1 : 0;
    }
    // Five standard errors of a share of 4000.
    const double power = equivalence_power(pairs, 1.0, margin);
    const double standard_error = std::sqrt(power * (1 - power) / kStudies);
    EXPECT_NEAR(static_cast<double>(shown) / kStudies, power, 5 * standard_error) << pairs;
    EXPECT_GT(power, 0.5);
    EXPECT_LT(power, 0.95);
  }
}

TEST(EquivalencePower, IsThatOfANormalDistributionForManyPairs) {
  // 2 Phi(margin / se - 1.6449) - 1 with se = 0.1 / sqrt(10000) = 0.001 and margin 0.003:
  // 2 Phi(1.3551) - 1 = 0.8246.
  EXPECT_NEAR(equivalence_power(10000, 0.1, 0.003), 0.8246, 1e-3);
  EXPECT_EQ(equivalence_power(10, 0.0, 0.1), 1.0);
  EXPECT_EQ(equivalence_power(3, 10.0, 0.1), 0.0);
}

TEST(EquivalencePower, PairsForAPowerAreTheFewestThatReachIt) {
  const std::size_t pairs = pairs_for_equivalence(0.3, 0.1, 0.9);
  EXPECT_GE(equivalence_power(pairs, 0.3, 0.1), 0.9);
  EXPECT_LT(equivalence_power(pairs - 1, 0.3, 0.1), 0.9);
  EXPECT_EQ(pairs_for_equivalence(1e6, 0.1, 0.9), 0u);
}

TEST(PairedComparison, HandlesEqualDifferences) {
  const std::vector<double> values = {1, 2, 3};
  const std::vector<double> shifted = {2, 3, 4};
  EXPECT_EQ(compare_paired(values, values, 0.1).t_test_p, 1.0);
  EXPECT_EQ(compare_paired(values, values, 0.1).equivalence_p, 0.0);
  EXPECT_EQ(compare_paired(values, shifted, 0.1).t_test_p, 0.0);
  EXPECT_EQ(compare_paired(values, shifted, 0.1).equivalence_p, 1.0);
}

TEST(PairedComparison, RefusesWhatIsNotPaired) {
  EXPECT_THROW(compare_paired(std::vector<double>{1, std::nan("")}, std::vector<double>{1, 2}, 0.1),
               InputError);
  const std::vector<double> values = {1, 2, 3};
  EXPECT_THROW(compare_paired(values, std::span(values).first(2), 1.0), InputError);
  EXPECT_THROW(compare_paired(std::span(values).first(1), std::span(values).first(1), 1.0),
               InputError);
  EXPECT_THROW(compare_paired(values, values, 0.0), InputError);
}

}  // namespace
}  // namespace af::evaluation
