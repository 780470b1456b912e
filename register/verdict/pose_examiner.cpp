// SPDX-License-Identifier: Apache-2.0
#include "register/verdict/pose_examiner.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "base/error.h"
#include "base/sample_summary.h"

namespace af::registration {
namespace {

/// Robust gradients are of no use within silhouettes. There the grain of the bone and of the
/// detector counts like an edge, and hides what the bone's edges explain.
StageOptions silhouette_stage(double silhouette_mm) {
  StageOptions stage;
  stage.similarity.name = "gc";
  stage.level = 1;
  stage.pixel_step = 4;
  stage.silhouette_mm = silhouette_mm;
  return stage;
}

/// Places in judging_stages().
constexpr std::size_t kCoarse = 0;
constexpr std::size_t kFine = 1;

/// Two stages that are only evaluated: the judge's, at the coarsest level that the view has up to
/// the judge's own, and one at level 0.
std::array<StageOptions, 2> judging_stages(const RegistrationView& view, double silhouette_mm) {
  StageOptions stage = silhouette_mm > 0.0 ? silhouette_stage(silhouette_mm) : JudgeOptions().stage;
  stage.optimizer = "gauss-newton";
  StageOptions fine = stage;
  stage.level = std::min(stage.level, static_cast<int>(view.coarse_levels.size()));
  fine.level = 0;
  return {stage, fine};
}

}  // namespace

/// None when the measure refuses the X-ray, because it has no gradients over most of the region.
std::optional<PoseExaminer::JudgedView> PoseExaminer::judged_view(
    const RegistrationProblem& problem, std::size_t view, double silhouette_mm) {
  const RegistrationView& judged = problem.views[view];
  try {
    return JudgedView{
        judged.view.camera,
        prepared_stages(problem, {&judged, 1}, judging_stages(judged, silhouette_mm), nullptr)};
  } catch (const InputError&) {
    return std::nullopt;
  }
}

double PoseExaminer::share_of(const ObjectiveValue& value) const {
  const double correlation = value.similarity;
  if (!in_silhouette_ || !std::isfinite(correlation)) return correlation;
  return std::pow(std::max(0.0, correlation), 2);
}

double PoseExaminer::share_beside(const RigidTransform& room_from_ct,
                                  double mm,
                                  JudgedView& view) const {
  const PoseFrame frame = PoseFrame::about(room_from_ct, problem_->center_ct_mm);
  std::vector<double> shares;
  for (const Eigen::Vector3d& direction : {view.camera.column_direction, view.camera.row_direction})
    for (const double way_mm : {-mm, mm}) {
      const RigidTransform beside =
          pose_from_parameters(frame, {.translation_mm = way_mm * direction});
      const double share = share_of(view.stages[kFine].value_in_place(*problem_, beside));
      if (std::isfinite(share)) shares.push_back(share);
    }
  return mean_of(shares);
}

int PoseExaminer::coarsest_level() {
  return JudgeOptions().stage.level;
}

PoseExaminer::PoseExaminer(std::shared_ptr<const RegistrationProblem> problem, double silhouette_mm)
    : problem_(std::move(problem)), in_silhouette_(silhouette_mm > 0.0) {
  for (std::size_t i = 0; i < problem_->views.size(); ++i)
    views_.push_back(judged_view(*problem_, i, silhouette_mm));
}

std::vector<ViewValue> PoseExaminer::view_values(const RigidTransform& room_from_ct,
                                                 bool with_backgrounds) {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  std::vector<ViewValue> values;
  for (std::optional<JudgedView>& view : views_) {
    ViewValue& value = values.emplace_back(ViewValue{kNone, kNone, in_silhouette_});
    if (!view) continue;
    value.coarse = share_of(view->stages[kCoarse].value_at(*problem_, room_from_ct));
    value.fine = share_of(view->stages[kFine].value_at(*problem_, room_from_ct));
    // Where the pose has no value, the stage looks somewhere else.
    if (!with_backgrounds || !std::isfinite(value.fine)) continue;
    for (const double part : {1.0, 0.5, 0.25}) {
      value.background = share_beside(room_from_ct, part * kBackgroundDistanceMm, *view);
      if (std::isfinite(value.background)) break;
    }
  }
  return values;
}

}  // namespace af::registration
