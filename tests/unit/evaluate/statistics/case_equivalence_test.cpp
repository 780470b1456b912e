// SPDX-License-Identifier: Apache-2.0
#include "evaluate/statistics/case_equivalence.h"

#include <cmath>
#include <limits>
#include <vector>

#include <gtest/gtest.h>

#include "base/error.h"
#include "support/interval_coverage.h"

namespace af::evaluation {
namespace {

TEST(CaseEquivalence, OfHandComputedCases) {
  // Mean 0.2, SD 0.1, standard error 0.05 over four patients. Student's quantile of 0.975 at three
  // degrees of freedom is 3.182446; at a margin of 0.3 t = 2, and P(t > 2) = 0.0696598.
  const std::vector<double> means = {0.1, 0.2, 0.2, 0.3};
  const CaseEquivalence found = equivalence_over_cases(means, 0.3, 1);
  const double standard_error = std::sqrt(0.02 / 3.0) / 2.0;
  constexpr double kMeanRounding = 1e-12;
  EXPECT_EQ(found.cases, 4u);
  EXPECT_NEAR(found.mean, 0.2, kMeanRounding);
  EXPECT_NEAR(found.student.high, 0.2 + 3.182446305284263 * standard_error, 1e-9);
  EXPECT_NEAR(found.student.low, 0.2 - 3.182446305284263 * standard_error, 1e-9);
  // Three degrees of freedom have a distribution in closed form.
  const double t = 0.1 / standard_error;
  const double x = t / std::sqrt(3.0);
  EXPECT_NEAR(found.p, 0.5 - (std::atan(x) + x / (1.0 + x * x)) / M_PI, kMeanRounding);
  EXPECT_GE(found.bootstrap.low, 0.1);
  EXPECT_LE(found.bootstrap.high, 0.3);
  EXPECT_FALSE(found.has_enough_cases());
  EXPECT_FALSE(found.is_shown()) << "four patients claim nothing, however close";
}

TEST(CaseEquivalence, IsShownByEnoughClosePatientsAndNotByFarOnes) {
  std::vector<double> means;
  for (int i = 0; i < 12; ++i) means.push_back(0.02 + 0.002 * i);
  EXPECT_TRUE(equivalence_over_cases(means, 0.05, 1).is_shown());
  EXPECT_FALSE(equivalence_over_cases(means, 0.03, 1).is_shown()) << "their mean is 0.031";
  means.resize(9);
  EXPECT_FALSE(equivalence_over_cases(means, 0.05, 1).is_shown()) << "nine are too few";
}

TEST(CaseEquivalence, OfPatientsThatAreAllAlikeHasNoSpread) {
  // Sums of 0.25 are exact, those of 0.04 are not.
  for (const double mean : {0.25, 0.04}) {
    const std::vector<double> means(10, mean);
    const CaseEquivalence close = equivalence_over_cases(means, 2 * mean, 1);
    EXPECT_EQ(close.p, 0.0);
    EXPECT_TRUE(close.is_shown());
  }
  const CaseEquivalence far = equivalence_over_cases(std::vector<double>(10, 0.25), 0.25, 1);
  EXPECT_EQ(far.p, 1.0);
  EXPECT_FALSE(far.is_shown()) << "at the margin is not below it";
  EXPECT_TRUE(std::isnan(equivalence_over_cases(std::vector<double>(10, 0.25), 1, 1).student.high));
}

TEST(CaseEquivalence, OfOneOrNoPatientSaysNothing) {
  EXPECT_TRUE(std::isnan(equivalence_over_cases({}, 0.1, 1).p));
  EXPECT_TRUE(std::isnan(equivalence_over_cases({}, 0.1, 1).mean));
  const std::vector<double> one = {0.01};
  EXPECT_TRUE(std::isnan(equivalence_over_cases(one, 0.1, 1).p));
  EXPECT_FALSE(equivalence_over_cases(one, 0.1, 1).is_shown());
}

TEST(CaseEquivalence, RefusesWhatIsNoDistanceOrNoMargin) {
  const double infinite = std::numeric_limits<double>::infinity();
  for (const double bad : {-0.1, std::nan(""), infinite})
    EXPECT_THROW(equivalence_over_cases(std::vector<double>{0.1, bad}, 0.1, 1), InputError) << bad;
  for (const double bad : {0.0, -0.1, std::nan(""), infinite})
    EXPECT_THROW(equivalence_over_cases(std::vector<double>{0.1, 0.2}, bad, 1), InputError) << bad;
}

TEST(CaseEquivalence, IsRarelyClaimedWrongly) {
  // The true mean of these patients is exactly the margin, so every claim is wrong. Their values
  // are skewed, as distances are.
  const auto claims = [](std::size_t cases) {
    return test::wrong_equivalence_claims(
        {.cases = cases, .log_sd = 0.4, .studies = 1000, .seed = 1, .replicates = 200});
  };
  // docs/data/equivalence-claims.csv has 5.9 and 4.1 %; five standard errors of 0.75 %.
  EXPECT_LT(claims(10), 0.06 + 5 * 0.0075);
  EXPECT_LT(claims(30), 0.05 + 5 * 0.0075);
  EXPECT_GT(claims(10), 0.0) << "the simulation claims nothing at all";
  EXPECT_EQ(claims(9), 0.0) << "nine are too few";
}

}  // namespace
}  // namespace af::evaluation
