// SPDX-License-Identifier: Apache-2.0
#include "base/sample_summary.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"

namespace af {
double mean_of(std::span<const double> values) {
  double sum = 0.0;
  for (const double value : values) sum += value;
  return sum / static_cast<double>(values.size());
}

double standard_deviation_of(std::span<const double> values, double mean) {
  if (values.size() < 2) return kNan;
  double squares = 0.0;
  for (const double value : values) squares += (value - mean) * (value - mean);
  return std::sqrt(squares / static_cast<double>(values.size() - 1));
}

double quantile(std::span<const double> sorted, double p) {
  check(!sorted.empty(), "a quantile needs a value");
  check(p >= 0.0 && p <= 1.0, "a quantile's p lies between 0 and 1");
  const double position = p * static_cast<double>(sorted.size() - 1);
  const auto below = static_cast<std::size_t>(position);
  const double fraction = position - static_cast<double>(below);
  // Otherwise 0 * inf would turn up where the neighbour is infinite.
  if (fraction == 0.0 || sorted[below] == sorted[below + 1]) return sorted[below];
  return sorted[below] + fraction * (sorted[below + 1] - sorted[below]);
}

SampleSummary summarize(std::vector<double> values) {
  SampleSummary summary{0, kNan, kNan, kNan, kNan, kNan, kNan, kNan, kNan, kNan};
  if (values.empty()) return summary;
  for (const double value : values)
    if (std::isnan(value)) throw InputError("statistics: a value is NaN; count it as missing");
  std::sort(values.begin(), values.end());
  summary.count = values.size();
  summary.mean = mean_of(values);
  summary.standard_deviation = standard_deviation_of(values, summary.mean);
  summary.minimum = values.front();
  summary.percentile_5 = quantile(values, 0.05);
  summary.lower_quartile = quantile(values, 0.25);
  summary.median = quantile(values, 0.5);
  summary.upper_quartile = quantile(values, 0.75);
  summary.percentile_95 = quantile(values, 0.95);
  summary.maximum = values.back();
  return summary;
}

}  // namespace af
