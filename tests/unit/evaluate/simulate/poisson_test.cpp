// SPDX-License-Identifier: Apache-2.0
#include "evaluate/simulate/poisson.h"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

namespace af {
namespace {

/// Sample mean and variance of many draws.
struct Moments {
  double mean = 0.0;
  double variance = 0.0;
};

Moments poisson_moments(double mean, int draws) {
  double sum = 0.0;
  double sum_of_squares = 0.0;
  for (int i = 0; i < draws; ++i) {
    HashRandom random(5, 17, static_cast<std::uint64_t>(i));
    const double deviation = static_cast<double>(draw_poisson(mean, random)) - mean;
    sum += deviation;
    sum_of_squares += deviation * deviation;
  }
  return {mean + sum / draws, sum_of_squares / draws};
}

TEST(Poisson, HasMeanAndVarianceOfItsParameter) {
  constexpr int kDraws = 200000;
  for (const double mean : {0.05, 1.0, 9.9, 10.1, 30.0, 1000.0, 3e5}) {
    const Moments moments = poisson_moments(mean, kDraws);
    // Five standard errors: of the mean sqrt(m / n), of the variance sqrt((m + 2 m^2) / n).
    EXPECT_NEAR(moments.mean, mean, 5.0 * std::sqrt(mean / kDraws));
    EXPECT_NEAR(moments.variance, mean, 5.0 * std::sqrt((mean + 2.0 * mean * mean) / kDraws));
  }
}

TEST(Poisson, HasTheDistributionsProbabilities) {
  // Both algorithms, by chi-square over the bulk: 99.99 % quantile of chi-square with up to 30
  // degrees of freedom is below 70.
  constexpr int kDraws = 100000;
  constexpr double kChiSquareLimit = 70.0;
  for (const double mean : {4.0, 14.0}) {
    std::vector<double> counts(200, 0.0);
    for (int i = 0; i < kDraws; ++i) {
      HashRandom random(6, 18, static_cast<std::uint64_t>(i));
      counts.at(static_cast<std::size_t>(draw_poisson(mean, random))) += 1.0;
    }
    double chi_square = 0.0;
    double probability = std::exp(-mean);
    for (std::size_t k = 0; k < 40; ++k) {
      const double expected = kDraws * probability;
      if (expected > 20.0) chi_square += (counts[k] - expected) * (counts[k] - expected) / expected;
      probability *= mean / (static_cast<double>(k) + 1.0);
    }
    EXPECT_LT(chi_square, kChiSquareLimit) << "mean " << mean;
  }
}

TEST(Poisson, GivesNothingForNothing) {
  HashRandom random(1);
  EXPECT_EQ(draw_poisson(0.0, random), 0);
  EXPECT_EQ(draw_poisson(-1.0, random), 0);
  EXPECT_EQ(draw_poisson(std::nan(""), random), 0);
}

}  // namespace
}  // namespace af
