// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "evaluate/statistics/statistics.h"

namespace af::evaluation {

/// With fewer cases the percentile interval is too narrow. docs/errors.md says how often it
/// contains the truth of simulated studies. \test IntervalCoverage.OfTheBootstrapGrowsWithTheCases
inline constexpr std::size_t kEnoughCases = 30;

/// Percentile interval of a statistic under resampling of cases.
struct CaseBootstrap {
  std::size_t cases = 0;
  std::size_t replicates = 0;
  std::size_t undefined = 0;  ///< replicates whose statistic is NaN; they are left out
  double low = 0.0;           ///< 95 %; NaN when less than two cases or no replicate has a value
  double high = 0.0;

  [[nodiscard]] bool is_optimistic() const { return cases < kEnoughCases; }
};

inline constexpr std::size_t kBootstrapReplicates = 2000;

/// 95 % percentile bootstrap interval (Efron 1979) of `statistic` over `cases` cases, drawn with
/// replacement. Patients are the unit that is sampled, because starts of one patient share a CT and
/// its X-rays. The statistic is given the drawn case numbers. Depends only on (cases, seed,
/// replicates).
CaseBootstrap bootstrap_over_cases(
    std::size_t cases,
    const std::function<double(std::span<const std::size_t> drawn)>& statistic,
    std::uint64_t seed,
    std::size_t replicates = kBootstrapReplicates);

/// A mean over one case, as a sum and the number of its terms.
struct CaseMean {
  double sum = 0.0;
  double count = 0.0;
};

/// A mean over cases with both kinds of 95 % intervals.
struct MeanOverCases {
  double value = 0.0;       ///< over all terms together
  CaseBootstrap bootstrap;  ///< of that value
  /// Interval of the mean of the cases' own means, in which every case has the same weight.
  MeanInterval student;
};

MeanOverCases mean_over_cases(const std::vector<CaseMean>& cases, std::uint64_t seed);

}  // namespace af::evaluation
