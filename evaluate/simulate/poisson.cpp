// SPDX-License-Identifier: Apache-2.0
#include "evaluate/simulate/poisson.h"

#include <cmath>
#include <numbers>

namespace af {

namespace {

/// log(k!), by Stirling's series from 10 on (error below 1e-12). std::lgamma would write to a
/// global.
double log_factorial(double k) {
  double shift = 0.0;
  double x = k + 1.0;
  while (x < 10.0) {
    shift += std::log(x);
    x += 1.0;
  }
  const double inverse = 1.0 / x;
  const double square = inverse * inverse;
  const double series =
      inverse * (1.0 / 12.0 - square * (1.0 / 360.0 - square * (1.0 / 1260.0 - square / 1680.0)));
  return (x - 0.5) * std::log(x) - x + 0.5 * std::log(2.0 * std::numbers::pi) + series - shift;
}

std::int64_t draw_by_products(double mean, HashRandom& random) {
  const double limit = std::exp(-mean);
  std::int64_t count = 0;
  double product = random.uniform();
  while (product > limit) {
    ++count;
    product *= random.uniform();
  }
  return count;
}

std::int64_t draw_by_rejection(double mean, HashRandom& random) {
  const double log_mean = std::log(mean);
  const double b = 0.931 + 2.53 * std::sqrt(mean);
  const double a = -0.059 + 0.02483 * b;
  const double inverse_alpha = 1.1239 + 1.1328 / (b - 3.4);
  const double v_r = 0.9277 - 3.6224 / (b - 2.0);
  while (true) {
    const double u = random.uniform() - 0.5;
    const double v = random.uniform();
    const double us = 0.5 - std::abs(u);
    const double k = std::floor((2.0 * a / us + b) * u + mean + 0.43);
    if (us >= 0.07 && v <= v_r) return static_cast<std::int64_t>(k);
    if (k < 0.0 || (us < 0.013 && v > us)) continue;
    if (std::log(v * inverse_alpha / (a / (us * us) + b)) <= k * log_mean - mean - log_factorial(k))
      return static_cast<std::int64_t>(k);
  }
}

}  // namespace

std::int64_t draw_poisson(double mean, HashRandom& random) {
  constexpr double kSmallMean = 10.0;
  if (!(mean > 0.0)) return 0;
  return mean < kSmallMean ? draw_by_products(mean, random) : draw_by_rejection(mean, random);
}

}  // namespace af
