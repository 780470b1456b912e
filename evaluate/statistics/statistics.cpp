// SPDX-License-Identifier: Apache-2.0
#include "evaluate/statistics/statistics.h"

#include <algorithm>
#include <boost/math/distributions/non_central_t.hpp>
#include <boost/math/distributions/students_t.hpp>
#include <cmath>
#include <string>

#include "base/error.h"

namespace af::evaluation {

MeanInterval student_interval(std::span<const double> values) {
  if (values.size() < 2) return {kNan, kNan};
  const double mean = mean_of(values);
  const double spread = standard_deviation_of(values, mean);
  if (!(spread > 0.0)) return {kNan, kNan};
  const auto n = static_cast<double>(values.size());
  const double half =
      boost::math::quantile(boost::math::students_t(n - 1.0), 0.975) * spread / std::sqrt(n);
  return {mean - half, mean + half};
}

PairedComparison compare_paired(std::span<const double> first,
                                std::span<const double> second,
                                double margin) {
  if (first.size() != second.size() || first.size() < 2)
    throw InputError("a paired test needs two or more pairs, found " +
                     std::to_string(first.size()) + " and " + std::to_string(second.size()) +
                     " values");
  if (!(margin > 0.0))
    throw InputError("equivalence margin", std::to_string(margin), "must be > 0");
  std::vector<double> differences(first.size());
  for (std::size_t i = 0; i < first.size(); ++i) {
    differences[i] = first[i] - second[i];
    if (!std::isfinite(differences[i]))
      throw InputError("a paired test", std::to_string(differences[i]), "needs finite values");
  }

  PairedComparison result;
  result.pairs = differences.size();
  result.margin = margin;
  result.mean_difference = mean_of(differences);
  const auto n = static_cast<double>(differences.size());
  result.standard_error = standard_deviation_of(differences, result.mean_difference) / std::sqrt(n);
  if (result.standard_error == 0.0) {
    result.t_test_p = result.mean_difference == 0.0 ? 1.0 : 0.0;
    result.equivalence_p = std::abs(result.mean_difference) < margin ? 0.0 : 1.0;
    result.low_90 = result.high_90 = result.mean_difference;
    result.equivalence_power = 1.0;
    return result;
  }
  const boost::math::students_t distribution(n - 1.0);
  const auto upper_tail = [&](double t) { return cdf(complement(distribution, t)); };
  result.t_test_p = 2.0 * upper_tail(std::abs(result.mean_difference) / result.standard_error);
  const double closer_limit = margin - std::abs(result.mean_difference);
  result.equivalence_p = upper_tail(closer_limit / result.standard_error);
  const double half_90 = boost::math::quantile(distribution, 0.95) * result.standard_error;
  result.low_90 = result.mean_difference - half_90;
  result.high_90 = result.mean_difference + half_90;
  result.equivalence_power =
      equivalence_power(result.pairs, result.standard_error * std::sqrt(n), margin);
  return result;
}

double equivalence_power(std::size_t pairs, double standard_deviation, double margin) {
  check(pairs >= 2, "a paired test needs two or more pairs");
  check(standard_deviation >= 0.0 && margin > 0.0, "a spread is not negative, a margin positive");
  const auto n = static_cast<double>(pairs);
  const double noncentrality = margin * std::sqrt(n) / standard_deviation;
  // Far beyond any quantile at 5 % of two or more pairs, where the series of the noncentral
  // distribution may no longer converge (also without any spread).
  constexpr double kCertain = 50.0;
  if (!(noncentrality < kCertain)) return 1.0;
  const double critical = boost::math::quantile(boost::math::students_t(n - 1.0), 0.95);
  const boost::math::non_central_t distribution(n - 1.0, noncentrality);
  return std::max(0.0, 1.0 - 2.0 * cdf(distribution, critical));
}

std::size_t pairs_for_equivalence(double standard_deviation, double margin, double power) {
  check(power > 0.0 && power < 1.0, "a power lies between 0 and 1");
  const auto reaches = [&](std::size_t pairs) {
    return equivalence_power(pairs, standard_deviation, margin) >= power;
  };
  constexpr std::size_t kMostPairs = 1000000;
  if (!reaches(kMostPairs)) return 0;
  std::size_t too_few = 1;
  std::size_t enough = kMostPairs;
  while (enough - too_few > 1) {
    const std::size_t middle = (too_few + enough) / 2;
    (reaches(middle) ? enough : too_few) = middle;
  }
  return enough;
}

}  // namespace af::evaluation
