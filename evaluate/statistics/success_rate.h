// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace af::evaluation {

/// The paper's threshold: an end with an error below this is a success (Sec. IV-B).
inline constexpr double kSuccessTreMm = 2.5;

/// Thresholds below which ends are counted, mm.
inline constexpr std::array<double, 5> kLadderMm = {1.0, 2.0, 2.5, 5.0, 10.0};

/// The share of starts that must succeed inside a capture range.
inline constexpr double kCaptureShare = 0.95;

struct ProportionInterval {
  double low = 0.0;
  double high = 1.0;
};

/// Score interval of a proportion (Wilson 1927). Its two-sided coverage stays close to `confidence`
/// even for few trials and rates near 0 or 1. Without trials it is [0, 1].
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
  double error_mm = 0.0;  ///< of the end; NaN: the registration failed
};

/// Number of outcomes with an error below `threshold_mm`. NaN never is.
std::int64_t count_successes(std::span<const TreOutcome> outcomes, double threshold_mm);

/// The initial TRE up to which enough of all starts together succeed.
struct CumulativeCaptureRange {
  double initial_tre_mm = 0.0;  ///< the largest initial TRE with enough success up to it
  std::int64_t starts = 0;      ///< how many began at or below it
  std::int64_t successes = 0;
  bool is_whole_study = false;  ///< it is the farthest start, so the true range may be larger
};

/// The largest initial TRE d of any outcome such that at least `share` of the outcomes with an
/// initial TRE of at most d succeeded; nullopt when there is none. Outcomes without an initial TRE
/// are left out. Many close starts that succeed make up for far ones that fail. The range therefore
/// reaches at least to the farthest start inside capture_range(), and often much farther. \test
/// CumulativeCaptureRange.IsTheLargestErrorWithEnoughSuccessBelowIt
std::optional<CumulativeCaptureRange> cumulative_capture_range(std::span<const TreOutcome> outcomes,
                                                               double share = kCaptureShare,
                                                               double threshold_mm = kSuccessTreMm);

/// Success per interval [k, k + 1) * width. Outcomes whose initial TRE lies beyond the last
/// interval are left out.
std::vector<IntervalSuccess> success_per_interval(std::span<const TreOutcome> outcomes,
                                                  int intervals,
                                                  double width_mm,
                                                  double threshold_mm = kSuccessTreMm);

/// Sums, interval by interval, the starts of the cases that `drawn` names, as often as it names
/// them. All cases have the same intervals. Wilson's interval is left as it was.
std::vector<IntervalSuccess> pooled_intervals(std::span<const std::vector<IntervalSuccess>> cases,
                                              std::span<const std::size_t> drawn);

/// What ends a capture range.
enum class CaptureEnd {
  Failures,      ///< an interval in which too few starts succeeded
  NoStarts,      ///< an interval without starts: what follows is unknown
  LastInterval,  ///< the study: every interval had enough success
};

/// "failures", "no starts" or "last interval".
const char* to_string(CaptureEnd end);

/// Capture range: how far registrations may start.
struct CaptureRange {
  double initial_tre_mm = 0.0;  ///< upper end of the last interval with enough success; 0: none
  std::int64_t starts = 0;      ///< in the intervals up to there
  std::int64_t successes = 0;
  CaptureEnd end = CaptureEnd::NoStarts;
  std::size_t end_interval =
      0;  ///< the interval that ends it, from 0; the number of intervals: none does

  /// Whether the true range may be larger.
  [[nodiscard]] bool is_whole_study() const { return end != CaptureEnd::Failures; }
};

/// The capture range of van de Kraats et al. (IEEE TMI 24(9), 2005): the first interval of initial
/// TRE with a success below `share` ends it. `intervals` come from success_per_interval().
/// \test CaptureRange.EndsAtTheFirstIntervalWithTooManyFailures
CaptureRange capture_range(std::span<const IntervalSuccess> intervals,
                           double share = kCaptureShare);

}  // namespace af::evaluation
