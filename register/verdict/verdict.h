// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <limits>
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

/// How much of an X-ray's gradients, over twice the region, the DRR at a pose explains, at the
/// judge's coarse level and at the renderer's own: 0 as without a DRR, 1 all, NaN where it cannot
/// be judged.
struct ViewValue {
  double coarse = 0.0;
  double fine = 0.0;
  /// Whether the values are those within the CT's silhouette: the squared correlation of the
  /// gradients there (0 where it is negative), which is the share that a gain times the DRR
  /// explains.
  bool in_silhouette = false;
  /// The share in detail that poses beside this one explain on average
  /// (PoseExaminer::view_values); NaN where that was not asked for, or none can be judged.
  double background = std::numeric_limits<double>::quiet_NaN();

  auto members() { return std::tie(coarse, fine, in_silhouette, background); }
};

/// Limits by what was measured (docs/registration-study.md, Verdicts). An end whose means over the
/// views are lower is not found: right poses under every stress at once had 0.29 and 0.11 or more.
inline constexpr double kLeastCoarseMean = 0.2;
inline constexpr double kLeastFineMean = 0.08;

/// Every view of a found pose reaches these values; for wrong poses, at least one view does not.
inline constexpr double kLeastCoarseOfFound = 0.3;
inline constexpr double kLeastFineOfFound = 0.3;

/// What the values of a kind must reach.
struct VerdictLimits {
  double coarse_mean;      ///< less: not found
  double fine_mean;        ///< less: not found
  double coarse_of_found;  ///< every view of a found pose has it
  double fine_of_found;    ///< every view of a found pose has it
};

inline constexpr VerdictLimits kRegionLimits = {
    kLeastCoarseMean, kLeastFineMean, kLeastCoarseOfFound, kLeastFineOfFound};

/// Within silhouettes, by what was measured (docs/howto/bones.md, Verdicts): right poses had 0.36
/// and 0.26 or more in every view; of 59 wrong ends none had 0.2 or more in detail in both views.
inline constexpr VerdictLimits kSilhouetteLimits = {0.2, 0.12, 0.3, 0.23};

/// By which limits values are judged.
const VerdictLimits& limits_of(std::span<const ViewValue> values);

/// A view disagrees when its coarse or fine value is below both the limit of a found pose and this
/// share of the other views' highest value, provided that this highest value reaches the limit.
inline constexpr double kLeastShareOfOthers = 0.5;

/// The verdict from the search's stop reason and the views' values at its end. `pinned_along`:
/// RegistrationResult's.
Judgement judged_end(StopReason stop_reason,
                     std::span<const ViewValue> values,
                     const std::string& pinned_along = "");

/// What one view leaves open of a pose that it shows: "depth along the beam within 24 mm", rounded
/// up; NaN: not known.
std::string depth_text(double depth_95_mm);

/// Whether the other views agree with the pose much better than this one.
bool disagrees(std::size_t view, std::span<const ViewValue> values);

/// Mean and lowest of one of the values over the views that can be judged; NaN when none can.
struct ViewSummary {
  double mean = 0.0;
  double lowest = 0.0;

  auto members() { return std::tie(mean, lowest); }
};
ViewSummary summary_of(std::span<const ViewValue> values, double ViewValue::*value);

/// Mean background of the views that can be judged; NaN when one of them has none, so that it is
/// of the same views as summary_of() of `fine`.
/// \test PoseExaminer.MeanBackgroundIsOfTheViewsThatAreJudged
double mean_background(std::span<const ViewValue> values);

/// By how much more the pose explains in detail than poses beside it: the harmonic mean over the
/// views that can be judged, of `fine` less `background`. A right pose explains every view, so it
/// is 0 when a view has no more than its background. NaN when a judged view has none, or no view
/// can be judged.
/// \test PoseExaminer.AViewThatShowsNothingLeavesNoExcess
double explained_excess(std::span<const ViewValue> values);

/// What the views' values say together.
struct JudgeSummary {
  ViewSummary coarse;
  ViewSummary fine;
  double background = 0.0;  ///< mean_background()
  double excess = 0.0;      ///< explained_excess()

  auto members() { return std::tie(coarse, fine, background, excess); }
};
JudgeSummary judge_summary(std::span<const ViewValue> values);

}  // namespace af::registration
