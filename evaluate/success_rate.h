// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace af::evaluation {

/// The paper's: TRE below this is a success (Sec. IV-B).
inline constexpr double kSuccessTreMm = 2.5;

struct ProportionInterval {
  double low = 0.0;
  double high = 1.0;
};

/// Score interval of a proportion (Wilson 1927), the two-sided `confidence` of which stays close to
/// nominal even for few trials and rates near 0 or 1. Without trials [0, 1].
/// \test WilsonInterval.EqualsPublishedValues
ProportionInterval wilson_interval(std::int64_t successes,
                                   std::int64_t trials,
                                   double confidence = 0.95);

/// Success among the starts of one interval of initial TRE.
struct IntervalSuccess {
  double low_mm = 0.0;
  double high_mm = 0.0;
  std::int64_t trials = 0;
  std::int64_t successes = 0;
  ProportionInterval wilson;

  [[nodiscard]] double rate() const {
    return static_cast<double>(successes) / static_cast<double>(trials);
  }
};

/// One registration for the success statistics.
struct TreOutcome {
  double initial_tre_mm = 0.0;
  double tre_mm = 0.0;  ///< NaN: failed
};

/// Number of outcomes with TRE below `threshold_mm`; NaN never is.
std::int64_t count_successes(std::span<const TreOutcome> outcomes, double threshold_mm);

/// Success per interval [k, k + 1) * width; outcomes whose initial TRE lies beyond the last
/// interval are left out.
std::vector<IntervalSuccess> success_per_interval(std::span<const TreOutcome> outcomes,
                                                  int intervals,
                                                  double width_mm,
                                                  double threshold_mm = kSuccessTreMm);

}  // namespace af::evaluation
