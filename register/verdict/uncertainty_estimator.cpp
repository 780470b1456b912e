// SPDX-License-Identifier: Apache-2.0
#include "register/verdict/uncertainty_estimator.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/error.h"
#include "register/problem/pose_target.h"
#include "register/problem/target_region.h"
#include "register/verdict/calibration.h"
#include "register/verdict/pose_covariance.h"
#include "register/verdict/pose_information.h"

namespace af::registration {
namespace {

/// Along each axis of a region: wide enough that what a DRR does not explain hardly reaches across,
/// and enough of them to estimate six variances.
constexpr int kTiles = 8;

/// The stage as the curvature needs it: with derivatives, and with an optimiser that they suit.
/// Robust gradients are of no use within silhouettes (see PoseExaminer).
StageOptions differentiable(StageOptions stage) {
  if (!known_measure(stage.similarity.name).is_differentiable)
    stage.similarity.name = stage.silhouette_mm > 0.0 ? "gc" : "rg";
  stage.similarity.has_smooth_histogram = true;
  stage.optimizer = "gradient";
  return stage;
}

}  // namespace

void UncertaintyOptions::describe(Fields& field) {
  field.start_group("Uncertainty");
  field("no_uncertainty",
        is_left_out,
        "Do not say how far the pose may be from the truth: no covariance, no confidence. Saves "
        "some 13 DRRs with derivatives and 4 without per view");
  field("calibration_error_px",
        calibration_error_px,
        "Error of the cameras' calibration to include in covariances: the standard deviation "
        "of every view's shift along its columns and rows, px of the detector. X-rays cannot show "
        "it")
      .at_least(0.0)
      .finite();
  field.start_group("");
}

UncertaintyEstimator::UncertaintyEstimator(std::shared_ptr<const RegistrationProblem> problem,
                                           const RegistrationOptions& method,
                                           const UncertaintyOptions& options,
                                           const std::shared_ptr<ThreadPool>& pool)
    : problem_(std::move(problem)), options_(options) {
  if (options_.is_left_out) return;
  std::vector<StageOptions> ends;
  for (const ChainOptions& chain : method.chains) {
    const bool ends_with_finish = !method.finish.stages.empty();
    if (!ends_with_finish || ends.empty()) {
      const StageOptions& last = (ends_with_finish ? method.finish : chain).stages.back();
      ends.push_back(differentiable(last));
      similarities_.push_back(last.similarity.name);
    }
    stage_of_chain_[chain.name] = ends.size() - 1;
  }
  try {
    ends_ = prepared_stages(*problem_, problem_->views, ends, pool);
  } catch (const InputError&) {
    // rg, which replaces measures without derivative, rejects X-rays without gradients over most of
    // the region; the registration's own measure may accept them.
  }
}

double UncertaintyEstimator::add_covariance(const RegistrationResult& result,
                                            std::span<const ViewValue> view_values,
                                            UncertaintyReport& report) {
  const PoseFrame frame = PoseFrame::about(result.room_from_ct, problem_->center_ct_mm);
  const std::vector<View> views = views_at(*problem_, result.room_from_ct);
  const auto basis = projected_motion_basis(result.room_from_ct,
                                            problem_->center_ct_mm,
                                            problem_->scaling_points_ct,
                                            views,
                                            problem_->isocenter_point);
  if (!basis.has_value()) return UncertaintyReport::kNone;
  const std::size_t stage = stage_of_chain_.at(result.chain);
  // Values over the region say nothing of what silhouettes show, and the other way round.
  const bool in_silhouette = ends_[stage].options.silhouette_mm > 0.0;
  const auto is_of_the_stage = [&](const ViewValue& value) {
    return value.in_silhouette == in_silhouette;
  };
  if (!std::ranges::all_of(view_values, is_of_the_stage)) return UncertaintyReport::kNone;
  if (!ends_[stage].place_at(*problem_, result.room_from_ct)) return UncertaintyReport::kNone;
  const auto information = information_at(ends_[stage].objective, frame, *basis, kTiles);
  if (!information.has_value()) return UncertaintyReport::kNone;
  const auto sandwich = sandwich_covariance(*information);
  if (!sandwich.has_value()) return UncertaintyReport::kNone;
  const CovarianceInflation inflation = covariance_inflation(similarities_[stage], view_values);
  if (!std::isfinite(inflation.pose)) return UncertaintyReport::kNone;
  report.inflation = inflation.pose;
  report.tre_inflation = inflation.tre;
  const PoseMatrix by_cameras = calibration_covariance(
      *information, views, problem_->isocenter_point, options_.calibration_error_px);
  report.covariance_deg_mm = in_deg_mm(inflation.pose * *sandwich + by_cameras);
  if (problem_->target_points_ct.empty()) return UncertaintyReport::kNone;
  const PredictedTre tre =
      predicted_tre(inflation.tre * *sandwich + by_cameras, frame, problem_->target_points_ct);
  report.tre_rms_mm = tre.rms_mm;
  report.tre_95_mm = tre.upper_95_mm;
  return predicted_tre(*sandwich, frame, problem_->target_points_ct).rms_mm;
}

UncertaintyReport UncertaintyEstimator::report(const RegistrationResult& result,
                                               std::span<const ViewValue> view_values) {
  UncertaintyReport report;
  if (!is_on()) return report;
  if (!result.has_pose()) {
    report.confidence = 0.0;
    return report;
  }
  const double sandwich_tre_mm = add_covariance(result, view_values, report);
  report.confidence = success_confidence({view_values, sandwich_tre_mm});
  if (judged_end(result.stop_reason, view_values).verdict == Verdict::NotFound)
    report.confidence = 0.0;
  return report;
}

}  // namespace af::registration
