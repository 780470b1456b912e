// SPDX-License-Identifier: Apache-2.0
#include "evaluate/statistics/signed_rank_test.h"

#include <cmath>
#include <limits>
#include <vector>

#include <gtest/gtest.h>

#include "base/error.h"
#include "base/hash_random.h"

namespace af::evaluation {
namespace {

constexpr double kProbabilityRounding = 1e-12;

TEST(SignedRankTest, EqualsPublishedValues) {
  // Hollander and Wolfe (1973), depression scale of nine patients before and after tranquilliser;
  // R's example(wilcox.test): V = 40, one-sided exact p = 0.01953 = 10 / 512.
  const std::vector<double> before = {1.83, 0.50, 1.62, 2.48, 1.68, 1.88, 1.55, 3.06, 1.30};
  const std::vector<double> after = {0.878, 0.647, 0.598, 2.05, 1.06, 1.29, 1.06, 3.14, 1.29};
  std::vector<double> differences;
  for (std::size_t i = 0; i < before.size(); ++i) differences.push_back(before[i] - after[i]);
  const SignedRankTest result = signed_rank_test(differences);
  EXPECT_EQ(result.pairs_used, 9u);
  EXPECT_EQ(result.positive_ranks, 40.0);
  EXPECT_TRUE(result.is_exact);
  EXPECT_NEAR(result.p, 20.0 / 512, kProbabilityRounding);
}

TEST(SignedRankTest, CountsSignsByHandForThreeDifferences) {
  // Ranks 1, 2, 3, all positive: one of eight sign patterns on either side.
  EXPECT_NEAR(signed_rank_test(std::vector{0.1, 0.5, 0.2}).p, 2.0 / 8, kProbabilityRounding);
  // Negative rank 1: patterns with a sum of at most 1 are two of eight.
  EXPECT_NEAR(signed_rank_test(std::vector{-0.1, 0.5, 0.2}).p, 4.0 / 8, kProbabilityRounding);
}

TEST(SignedRankTest, GivesTiesTheirMeanRankAndLeavesZerosOut) {
  // Sizes 1, 1, 2: ranks 1.5, 1.5, 3; the negative sum 1.5 is reached or undercut by the patterns
  // {}, {1.5}, {1.5}: three of eight.
  const SignedRankTest result = signed_rank_test(std::vector{-1.0, 0.0, 1.0, 2.0, 0.0});
  EXPECT_EQ(result.zeros, 2u);
  EXPECT_EQ(result.positive_ranks, 4.5);
  EXPECT_NEAR(result.p, 6.0 / 8, kProbabilityRounding);
}

TEST(SignedRankTest, OfNothingOrZerosOnlyIsNotSignificant) {
  EXPECT_EQ(signed_rank_test({}).p, 1.0);
  EXPECT_EQ(signed_rank_test(std::vector{0.0, 0.0}).p, 1.0);
}

TEST(SignedRankTest, ItsNormalApproximationMeetsTheExactDistribution) {
  // 200 and 201 differences of the same kind: p must not jump where the method changes. Measured:
  // one more difference moves p by 0.01 here.
  std::vector<double> differences;
  HashRandom random(1);
  for (int i = 0; i < 200; ++i) differences.push_back(random.normal() + 0.1);
  const SignedRankTest exact = signed_rank_test(differences);
  differences.push_back(0.01);  // a small one: its rank is low
  const SignedRankTest approximate = signed_rank_test(differences);
  EXPECT_TRUE(exact.is_exact);
  EXPECT_FALSE(approximate.is_exact);
  EXPECT_GT(exact.p, 0.001);
  EXPECT_NEAR(exact.p, approximate.p, 0.02);
}

TEST(SignedRankTest, RefusesWhatIsNotFinite) {
  EXPECT_THROW(signed_rank_test(std::vector{0.1, std::nan("")}), InputError);
  EXPECT_THROW(signed_rank_test(std::vector<double>{0.1, std::numeric_limits<double>::infinity()}),
               InputError);
}

TEST(McNemar, IsTheBinomialTailOfDiscordantPairs) {
  EXPECT_EQ(mcnemar_exact_p(0, 0), 1.0);
  EXPECT_EQ(mcnemar_exact_p(3, 3), 1.0);
  EXPECT_NEAR(mcnemar_exact_p(0, 5), 2.0 / 32, kProbabilityRounding);
  EXPECT_NEAR(mcnemar_exact_p(6, 1), 2.0 * (1 + 7) / 128, kProbabilityRounding);
}

}  // namespace
}  // namespace af::evaluation
