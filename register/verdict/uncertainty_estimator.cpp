// SPDX-License-Identifier: Apache-2.0
#include "register/verdict/uncertainty_estimator.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/error.h"
#include "geometry/target_box.h"
#include "register/problem/pose_target.h"
#include "register/problem/target_region.h"
#include "register/verdict/calibration.h"
#include "register/verdict/pose_covariance.h"
#include "register/verdict/pose_information.h"

namespace af::registration {
namespace {

/// Number along each axis of a region. Tiles must be wide enough that what a DRR does not explain
/// hardly reaches across, and numerous enough to estimate six variances.
constexpr int kTiles = 8;

/// The stage as the curvature needs it: with derivatives, and with an optimiser that suits them.
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
        "Skip covariance and predicted TRE, which saves some 13 DRRs per view; af-register then "
        "finds fewer poses, af-evaluate gives no verdict");
  field("calibration_error_px",
        calibration_error_px,
        "Calibration error that covariances include: standard deviation of every view's shift "
        "along columns and rows, px")
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
    // rg replaces measures without derivative, and rejects X-rays without gradients over most of
    // the region. The registration's own measure may accept them.
  }
}

std::vector<Eigen::Vector2d> UncertaintyEstimator::shifts_mm(int level) const {
  std::vector<Eigen::Vector2d> shifts;
  for (const RegistrationView& view : problem_->views) {
    const CameraGeometry& camera = view.view.camera;
    const double mm_per_detector_mm =
        camera.depth_mm(problem_->isocenter_point) / camera.source_detector_distance_mm();
    const Eigen::Array2d by_calibration =
        options_.calibration_error_px * mm_per_detector_mm * camera.pixel_spacing_mm.array();
    const double by_interpolation =
        interpolation_shift_mm(std::ldexp(view.sample_spacing_mm, level));
    shifts.emplace_back((by_calibration.square() + std::pow(by_interpolation, 2)).sqrt());
  }
  return shifts;
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
  // Values over the region say nothing about what silhouettes show, and vice versa.
  const bool in_silhouette = ends_[stage].options.silhouette_mm > 0.0;
  const auto is_of_the_stage = [&](const ViewValue& value) {
    return value.in_silhouette == in_silhouette;
  };
  if (!std::ranges::all_of(view_values, is_of_the_stage)) return UncertaintyReport::kNone;
  if (!ends_[stage].place_at(*problem_, result.room_from_ct)) return UncertaintyReport::kNone;
  auto information = information_at(ends_[stage].objective, frame, *basis, kTiles);
  if (!information.has_value()) return UncertaintyReport::kNone;
  const auto flat_sandwich = sandwich_covariance(*information);
  // One view may really be that flat along its beam.
  if (views.size() > 1)
    information->curvature = bent_curvature(information->curvature, *basis, information->scatter);
  const auto sandwich = sandwich_covariance(*information);
  if (!flat_sandwich.has_value() || !sandwich.has_value()) return UncertaintyReport::kNone;
  const CovarianceInflation inflation = covariance_inflation(similarities_[stage], view_values);
  if (!std::isfinite(inflation.pose)) return UncertaintyReport::kNone;
  report.inflation = inflation.pose;
  report.tre_inflation = inflation.tre;
  const PoseMatrix by_shifts =
      shift_covariance(*information, views, shifts_mm(ends_[stage].options.level));
  report.covariance_deg_mm = in_deg_mm(inflation.pose * *sandwich + by_shifts);
  if (problem_->target_points_ct.empty()) return UncertaintyReport::kNone;
  const PoseMatrix of_target = inflation.tre * *sandwich + by_shifts;
  const std::vector<Eigen::Vector3d>& target_ct = problem_->target_points_ct;
  const PredictedTre tre = predicted_tre(of_target, frame, target_ct);
  report.tre_rms_mm = tre.rms_mm;
  report.tre_95_mm = tre.upper_95_mm;
  if (views.size() == 1)
    report.depth_95_mm =
        depth_95_mm(of_target, frame, mean_point(target_ct), views.front().camera.source_point);
  return predicted_tre(*flat_sandwich, frame, target_ct).rms_mm;
}

UncertaintyReport UncertaintyEstimator::report(const RegistrationResult& result,
                                               std::span<const ViewValue> view_values) {
  UncertaintyReport report;
  if (result.has_pose() && !ends_.empty())
    report.sandwich_tre_mm = add_covariance(result, view_values, report);
  const bool has_end = result.has_pose() && !failure_of(result.stop_reason).has_value();
  report.confidence = has_end ? success_confidence({view_values, report.sandwich_tre_mm}) : 0.0;
  return report;
}

}  // namespace af::registration
