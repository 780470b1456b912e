// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>
#include <tuple>

#include "register/optimizer/optimizer.h"

namespace af::registration {

/// Whether a registration's end may be taken for the patient's pose.
enum class Verdict { Found, Doubtful, NotFound };

/// "found", "doubtful", "not found": as in result files.
const char* to_string(Verdict verdict);

/// A verdict and why, in words.
struct Judgement {
  Verdict verdict = Verdict::NotFound;
  std::string reason;
};

/// The shares of an X-ray's gradients over twice the region that the DRR at a pose explains, at the
/// judge's coarse level and at the renderer's own: 0 is what no DRR explains, 1 is all, NaN where
/// it cannot be judged.
struct ViewValue {
  double coarse = 0.0;
  double fine = 0.0;

  auto members() { return std::tie(coarse, fine); }
};

/// Limits by what was measured (docs/registration-study.md, Verdicts). An end whose means over the
/// views are lower is not found: right poses under every stress at once had 0.34 and 0.11 or more.
inline constexpr double kLeastCoarseMean = 0.2;
inline constexpr double kLeastFineMean = 0.08;

/// Every view of a found pose has these values or more: of wrong poses one view or both have less.
inline constexpr double kLeastCoarseOfFound = 0.3;
inline constexpr double kLeastFineOfFound = 0.3;

/// A view disagrees with the others when its coarse or its fine value is less than this share of
/// their highest, and less than that of a found pose, which the highest is not.
inline constexpr double kLeastShareOfOthers = 0.5;

/// The verdict by why the search stopped and by what the views are worth at its end.
Judgement judged_end(StopReason stop_reason, std::span<const ViewValue> values);

/// Whether the other views agree with the pose much better than this one.
bool disagrees(std::size_t view, std::span<const ViewValue> values);

/// Mean and lowest of one of the values over the views that can be judged; NaN when none can.
struct ViewSummary {
  double mean = 0.0;
  double lowest = 0.0;

  auto members() { return std::tie(mean, lowest); }
};
ViewSummary summary_of(std::span<const ViewValue> values, double ViewValue::*value);

}  // namespace af::registration
