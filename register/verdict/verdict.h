// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <tuple>
#include <vector>

#include "register/method/registration_result.h"
#include "register/verdict/target_evidence.h"
#include "register/verdict/uncertainty_report.h"

namespace af::registration {

/// Whether a registration's end may be taken for the patient's pose.
enum class Verdict { Found, Doubtful, NotFound };
inline constexpr std::array kVerdicts{Verdict::Found, Verdict::Doubtful, Verdict::NotFound};

/// The names in result files: "found", "doubtful", "not found".
const char* to_string(Verdict verdict);

/// A verdict, and its reason in words.
struct Judgement {
  Verdict verdict = Verdict::NotFound;
  std::string reason;
};

/// How much of an X-ray's gradients the DRR at a pose explains, over twice the region, at the
/// judge's coarse level and at the renderer's own. 0 is as without a DRR, 1 is all, and NaN is
/// where it cannot be judged.
struct ViewValue {
  double coarse = 0.0;
  double fine = 0.0;
  /// Whether the values are those within the CT's silhouette: the squared correlation of the
  /// gradients there (0 where it is negative), which is the share that a gain times the DRR
  /// explains.
  bool in_silhouette = false;
  /// The share in detail that poses beside this one explain on average (PoseExaminer::view_values).
  /// NaN where that was not asked for, or none can be judged.
  double background = std::numeric_limits<double>::quiet_NaN();

  auto members() { return std::tie(coarse, fine, in_silhouette, background); }
};

/// The verdict is found when the end is wrong with at most this risk. It is not found when the end
/// is right with less than the probability below, and doubtful in between.
inline constexpr double kFoundRisk = 0.01;
inline constexpr double kLeastConfidence = 0.05;

/// The values of a view whose X-ray a pose explains beyond question. For a wrong pose, at least one
/// view has less (docs/registration-study.md, Verdicts). It guides the search for what is wrong
/// with X-rays, not the verdict, because right poses under stress have less too.
struct WellExplained {
  double coarse;
  double fine;
};
inline constexpr WellExplained kWellExplained = {0.3, 0.3};
/// The same within silhouettes, as measured (docs/howto/bones.md, Verdicts).
inline constexpr WellExplained kWellExplainedInSilhouettes = {0.3, 0.23};

/// A view disagrees when its coarse or fine value is below both that of a well explained view and
/// this share of the other views' highest value, provided that this highest value is well
/// explained.
inline constexpr double kLeastShareOfOthers = 0.5;

/// Why there is no end at all, according to why the search stopped.
std::optional<std::string> failure_of(StopReason stop_reason);

/// What leaves a doubt in an end, however probable it is: how the search stopped, an X-ray that
/// cannot be judged, and a target that shows nothing of its own or disagrees with its surroundings.
/// \test Judgement.ATargetThatDisagreesWithItsSurroundingsIsDoubtful
std::vector<std::string> doubts_of(const RegistrationResult& result,
                                   std::span<const ViewValue> values,
                                   const TargetEvidence& target);

/// Whether the target was asked, shows enough, and alone fits where its surroundings do.
bool agrees_with_surroundings(const TargetEvidence& target, std::span<const ViewValue> values);

/// The confidence in an end whose target agrees with its surroundings: its odds times
/// kAgreementOdds. \test Judgement.AnAgreeingTargetDoublesTheOdds
double confidence_if_target_agrees(double confidence);

/// The verdict by the probability that the end is right, UncertaintyReport::confidence. Where no
/// TRE is predicted, the confidence is a lower bound, and nothing is rejected by it.
Judgement judged_confidence(const UncertaintyReport& report, std::span<const ViewValue> values);

/// What one view leaves open in a pose: "depth along the beam within 24 mm", rounded up. NaN:
/// unknown.
std::string depth_text(double depth_95_mm);

/// Whether the other views agree with the pose much better than this one.
bool disagrees(std::size_t view, std::span<const ViewValue> values);

/// Mean and lowest of one of the values, over the views that can be judged. NaN when none can.
struct ViewSummary {
  double mean = 0.0;
  double lowest = 0.0;

  auto members() { return std::tie(mean, lowest); }
};
ViewSummary summary_of(std::span<const ViewValue> values, double ViewValue::*value);

/// Mean background of the views that can be judged. NaN when one of them has none, so that it
/// covers the same views as summary_of() of `fine`.
/// \test PoseExaminer.MeanBackgroundIsOfTheViewsThatAreJudged
double mean_background(std::span<const ViewValue> values);

/// How much more the pose explains in detail than poses beside it: the harmonic mean of `fine` less
/// `background`, over the views that can be judged. A right pose explains every view, so it is 0
/// when a view has no more than its background. NaN when a judged view has none, or no view can be
/// judged.
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
