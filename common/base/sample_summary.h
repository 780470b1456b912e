// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <limits>
#include <span>
#include <vector>

namespace af {

/// Value of a statistic for which the sample is too small.
inline constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

/// Quantile `p` in [0, 1] by linear interpolation between order statistics (Hyndman and Fan's type
/// 7, the default of R and NumPy). `sorted` is ascending and not empty; infinity is allowed.
double quantile(std::span<const double> sorted, double p);

/// Location and spread of a sample. Every value is NaN when the sample is empty.
struct SampleSummary {
  std::size_t count = 0;
  double mean = 0.0;
  double standard_deviation = 0.0;  ///< divides by n - 1; NaN for fewer than two values
  double minimum = 0.0;
  double percentile_5 = 0.0;
  double lower_quartile = 0.0;
  double median = 0.0;
  double upper_quartile = 0.0;
  double percentile_95 = 0.0;
  double maximum = 0.0;
};

/// Throws InputError when a value is NaN: callers must count missing values, not average them.
SampleSummary summarize(std::vector<double> values);

/// NaN for an empty sample.
double mean_of(std::span<const double> values);

/// Divides by n - 1. NaN for fewer than two values.
double standard_deviation_of(std::span<const double> values, double mean);

}  // namespace af
