// SPDX-License-Identifier: Apache-2.0
#include "evaluate/statistics/bootstrap.h"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "support/interval_coverage.h"

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
  // Of two cases the second has no value. A quarter of the replicates draw only that one.
  const std::vector<double> values = {1.0, std::nan("")};
  const CaseBootstrap result = bootstrap_over_cases(
      2, [&](auto drawn) { return drawn[0] == 1 && drawn[1] == 1 ? std::nan("") : values[0]; }, 1);
  // Five standard errors of a count of 2000 at 1/4: 5 * 19.4.
  EXPECT_NEAR(static_cast<double>(result.undefined), 500.0, 97.0);
  EXPECT_EQ(result.low, 1.0);
}

// Standard error of a share near 0.95 in 2000 studies: 0.005, near 0.8: 0.009.
constexpr std::uint64_t kStudies = 2000;

test::IntervalCoverage coverage_with(std::size_t cases) {
  test::SimulatedStudies setting;
  setting.cases = cases;
  setting.studies = kStudies;
  setting.replicates = 400;
  return interval_coverage(setting);
}

TEST(IntervalCoverage, OfTheBootstrapGrowsWithTheCases) {
  const test::IntervalCoverage four = coverage_with(4);
  const test::IntervalCoverage ten = coverage_with(10);
  const test::IntervalCoverage thirty = coverage_with(kEnoughCases);
  EXPECT_LT(four.bootstrap_rate, ten.bootstrap_rate);
  EXPECT_LT(ten.bootstrap_rate, thirty.bootstrap_rate);
  EXPECT_LT(four.bootstrap_tre, ten.bootstrap_tre);
  // From thirty cases on no warning is given.
  EXPECT_GT(thirty.bootstrap_rate, 0.93 - 0.01);
  EXPECT_LT(four.bootstrap_rate, 0.90) << "the warning about few cases would be wrong";
  // Student's interval is the remedy: within 3 % of what it claims, with four cases as with thirty.
  for (const test::IntervalCoverage& found : {four, ten, thirty})
    EXPECT_NEAR(found.student_rate, 0.95, 0.03);
  // Starts of patients who differ are not independent, however many they are.
  EXPECT_LT(four.wilson_rate, 0.90);
  EXPECT_LT(thirty.wilson_rate, 0.90);
}

TEST(IntervalCoverage, OfWilsonsIsNominalForIndependentRuns) {
  test::SimulatedStudies setting;
  setting.cases = 1;
  setting.half_spread = 0.0;
  setting.starts_per_case = 240;
  setting.studies = kStudies;
  setting.replicates = 1;
  for (const double rate : {0.5, 0.8, 0.93}) {
    setting.mean_rate = rate;
    const double share = interval_coverage(setting).wilson_rate;
    EXPECT_GT(share, 0.93) << rate;
    EXPECT_LT(share, 0.97) << rate;
  }
}

TEST(IntervalCoverage, OfRatesNearOneIsPoorWhereOfFailingPatientsItIsNot) {
  test::StudiesOfRareFailures setting;
  setting.hard_share = 1.0 / 90.0;
  setting.studies = kStudies;
  setting.replicates = 400;
  const test::RareFailureCoverage found = rare_failure_coverage(setting);
  // In half of these studies (1 - 1/90)^60 no patient fails: no interval of the rate exists.
  EXPECT_LT(found.bootstrap_rate, 0.60);
  EXPECT_LT(found.student_rate, 0.60);
  EXPECT_GT(found.wilson_patients, 0.93 - 0.01);
}

}  // namespace
}  // namespace af::evaluation
