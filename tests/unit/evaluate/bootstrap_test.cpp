// SPDX-License-Identifier: Apache-2.0
#include "evaluate/bootstrap.h"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "base/hash_random.h"
#include "evaluate/success_rate.h"

namespace af::evaluation {
namespace {

double mean_of(const std::vector<double>& values, std::span<const std::size_t> drawn) {
  double sum = 0.0;
  for (const std::size_t index : drawn) sum += values[index];
  return sum / static_cast<double>(drawn.size());
}

TEST(CaseBootstrap, OfOneCaseDoesNotExist) {
  const CaseBootstrap result = bootstrap_over_cases(
      1, [](auto) { return 1.0; }, 1);
  EXPECT_TRUE(std::isnan(result.low));
  EXPECT_TRUE(result.is_optimistic());
}

TEST(CaseBootstrap, DependsOnTheSeedAlone) {
  const std::vector<double> values = {1, 2, 3, 5, 8, 13};
  const auto low = [&](std::uint64_t seed) {
    return bootstrap_over_cases(
               values.size(), [&](auto drawn) { return mean_of(values, drawn); }, seed, 100)
        .low;
  };
  EXPECT_EQ(low(1), low(1));
  EXPECT_NE(low(1), low(2));
}

TEST(CaseBootstrap, CountsReplicatesWithoutAValue) {
  // Two cases, of which the second has none: it alone is drawn in a quarter of the replicates.
  const std::vector<double> values = {1.0, std::nan("")};
  const CaseBootstrap result = bootstrap_over_cases(
      2, [&](auto drawn) { return drawn[0] == 1 && drawn[1] == 1 ? std::nan("") : values[0]; }, 1);
  // Five standard errors of a count of 2000 at 1/4: 5 * 19.4.
  EXPECT_NEAR(static_cast<double>(result.undefined), 500.0, 97.0);
  EXPECT_EQ(result.low, 1.0);
}

/// Studies of `cases` patients whose own success rates are uniform about 0.8, 24 starts each.
double coverage(std::size_t cases) {
  constexpr std::uint64_t kStudies = 2000;
  constexpr int kStarts = 24;
  constexpr double kTrueRate = 0.8;
  int covered = 0;
  std::vector<double> rates(cases);
  for (std::uint64_t study = 0; study < kStudies; ++study) {
    HashRandom random(5, cases, study);
    for (double& rate : rates) {
      const double own = random.uniform(kTrueRate - 0.2, kTrueRate + 0.2);
      int successes = 0;
      for (int i = 0; i < kStarts; ++i) successes += random.uniform() < own ? 1 : 0;
      rate = static_cast<double>(successes) / kStarts;
    }
    const CaseBootstrap interval = bootstrap_over_cases(
        cases, [&](auto drawn) { return mean_of(rates, drawn); }, study, 400);
    covered += interval.low <= kTrueRate && kTrueRate <= interval.high ? 1 : 0;
  }
  return static_cast<double>(covered) / kStudies;
}

TEST(CaseBootstrap, CoversTheTruthTheMoreOftenTheMoreCases) {
  const double four = coverage(4);
  const double ten = coverage(10);
  const double thirty = coverage(30);
  RecordProperty("coverage_4_10_30",
                 std::to_string(four) + " " + std::to_string(ten) + " " + std::to_string(thirty));
  // Standard error of a share near 0.9 in 2000 studies: 0.007.
  EXPECT_LT(four, ten);
  EXPECT_LT(ten, thirty);
  EXPECT_GT(thirty, 0.95 - 0.03);
  EXPECT_LT(four, 0.90) << "the warning about few cases would be wrong";
}

TEST(WilsonInterval, CoversTheTruthInSimulatedStudies) {
  constexpr std::uint64_t kStudies = 2000;
  for (const double rate : {0.5, 0.8, 0.93}) {
    int covered = 0;
    for (std::uint64_t study = 0; study < kStudies; ++study) {
      HashRandom random(9, static_cast<std::uint64_t>(rate * 100), study);
      int successes = 0;
      for (int i = 0; i < 240; ++i) successes += random.uniform() < rate ? 1 : 0;
      const ProportionInterval interval = wilson_interval(successes, 240);
      covered += interval.low <= rate && rate <= interval.high ? 1 : 0;
    }
    const double share = static_cast<double>(covered) / kStudies;
    EXPECT_GT(share, 0.93) << rate;
    EXPECT_LT(share, 0.97) << rate;
  }
}

}  // namespace
}  // namespace af::evaluation
