// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "base/sample_summary.h"

namespace af::evaluation {

struct MeanInterval {
  double low = 0.0;
  double high = 0.0;
};

/// Student's 95 % interval of a mean of few, normally distributed values. NaN for fewer than two
/// values and for equal ones, which tell nothing about the spread.
/// \test StudentInterval.EqualsStudentsSleepData
MeanInterval student_interval(std::span<const double> values);

/// Comparison of two methods on the same items.
struct PairedComparison {
  std::size_t pairs = 0;
  double mean_difference = 0.0;  ///< first minus second
  double standard_error = 0.0;
  double t_test_p = 1.0;  ///< two-sided: the probability of such a mean if there were no difference
  double margin = 0.0;
  double equivalence_p = 1.0;  ///< two one-sided tests (Schuirmann 1987): below 0.05, the mean
                               ///< difference lies within +-margin at 95 % confidence
  double low_90 = 0.0;         ///< 90 % confidence interval of the mean difference, the one that
  double high_90 = 0.0;        ///< corresponds to the two one-sided tests at 5 %
  double equivalence_power = 0.0;  ///< see equivalence_power(), with the observed spread
};

/// Paired t-test and equivalence test. Throws InputError for unequal sizes, fewer than two pairs,
/// values that are not finite or a margin that is not positive. Differences that are all equal have
/// no spread, and p is then 0 or 1.
PairedComparison compare_paired(std::span<const double> first,
                                std::span<const double> second,
                                double margin);

/// Probability that two one-sided tests at 5 % show equivalence within +-margin when the true mean
/// difference is zero, for this many pairs whose differences have this standard deviation. It is
/// max(0, 1 - 2 F(t)), where F is the noncentral t distribution with pairs - 1 degrees of freedom
/// and noncentrality margin / (sd / sqrt(pairs)), and t the 95 % quantile of Student's (the usual
/// approximation to Owen 1965; Julious, Statistics in Medicine 2004).
/// \test EquivalencePower.EqualsTheShareOfSimulatedStudies
double equivalence_power(std::size_t pairs, double standard_deviation, double margin);

/// Fewest pairs with that much power, at most a million. 0 when even these do not reach it.
std::size_t pairs_for_equivalence(double standard_deviation, double margin, double power = 0.9);

}  // namespace af::evaluation
