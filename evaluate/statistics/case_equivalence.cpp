// SPDX-License-Identifier: Apache-2.0
#include "evaluate/statistics/case_equivalence.h"

#include <boost/math/distributions/students_t.hpp>
#include <cmath>
#include <string>

#include "base/error.h"
#include "base/sample_summary.h"

namespace af::evaluation {
namespace {

/// P(a mean at least this far below the margin) if the true mean were at the margin.
double below_margin_p(std::span<const double> values, double mean, double margin) {
  if (values.size() < 2) return kNan;
  const auto n = static_cast<double>(values.size());
  const double standard_error = standard_deviation_of(values, mean) / std::sqrt(n);
  // Equal values have a spread of rounding, which must not count as one of patients.
  constexpr double kRounding = 1e-12;
  if (!(standard_error > kRounding * mean)) return mean < margin ? 0.0 : 1.0;
  const boost::math::students_t distribution(n - 1.0);
  return cdf(complement(distribution, (margin - mean) / standard_error));
}

}  // namespace

bool CaseEquivalence::is_shown() const {
  if (!has_enough_cases()) return false;
  // Student's interval does not exist where all cases are alike. The bootstrap's is then a point.
  const bool is_student_below = std::isnan(student.high) ? p == 0.0 : student.high < margin;
  return is_student_below && bootstrap.high < margin;
}

// A margin is no whole number, and a seed comes first wherever numbers are drawn.
// NOLINTBEGIN(bugprone-easily-swappable-parameters)
CaseEquivalence equivalence_over_cases(std::span<const double> case_means,
                                       double margin,
                                       std::uint64_t seed,
                                       std::size_t replicates) {
  // NOLINTEND(bugprone-easily-swappable-parameters)
  if (!(margin > 0.0) || !std::isfinite(margin))
    throw InputError("equivalence margin", std::to_string(margin), "must be > 0 and finite");
  for (const double value : case_means)
    if (!(value >= 0.0) || !std::isfinite(value))
      throw InputError("a case's mean distance", std::to_string(value), "must be >= 0 and finite");
  CaseEquivalence result;
  result.cases = case_means.size();
  result.margin = margin;
  result.mean = mean_of(case_means);
  result.student = student_interval(case_means);
  result.bootstrap = bootstrap_over_cases(
      case_means.size(),
      [&](std::span<const std::size_t> drawn) {
        double sum = 0.0;
        for (const std::size_t index : drawn) sum += case_means[index];
        return sum / static_cast<double>(drawn.size());
      },
      seed,
      replicates);
  result.p = below_margin_p(case_means, result.mean, margin);
  return result;
}

}  // namespace af::evaluation
