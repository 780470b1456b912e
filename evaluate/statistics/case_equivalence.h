// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "evaluate/statistics/bootstrap.h"
#include "evaluate/statistics/statistics.h"

namespace af::evaluation {

/// With fewer patients, equivalence is neither claimed nor denied. docs/errors.md says how often
/// studies of this size claim it wrongly. \test CaseEquivalence.IsRarelyClaimedWrongly
inline constexpr std::size_t kEnoughCasesForEquivalence = 10;

/// Whether the mean over patients of a distance is below a margin. A distance is never negative, so
/// opposite errors do not cancel.
struct CaseEquivalence {
  std::size_t cases = 0;
  double mean = 0.0;        ///< of the cases' own means; NaN without cases
  MeanInterval student;     ///< 95 %, over the cases' own means
  CaseBootstrap bootstrap;  ///< 95 %, the same by resampling of cases
  double margin = 0.0;
  /// One-sided Student's test over cases of a mean at or above the margin. NaN for fewer than two
  /// cases. Cases that are all alike have no spread, and p is then 0 or 1.
  double p = 0.0;

  [[nodiscard]] bool has_enough_cases() const { return cases >= kEnoughCasesForEquivalence; }
  /// Enough cases, and both 95 % intervals end below the margin.
  [[nodiscard]] bool is_shown() const;
};

/// `case_means` has one value per case: the mean over its own starts. Throws InputError when a
/// value is not finite or is negative, or the margin is not positive.
/// \test CaseEquivalence.OfHandComputedCases
CaseEquivalence equivalence_over_cases(std::span<const double> case_means,
                                       double margin,
                                       std::uint64_t seed,
                                       std::size_t replicates = kBootstrapReplicates);

}  // namespace af::evaluation
