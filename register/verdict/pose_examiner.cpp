// SPDX-License-Identifier: Apache-2.0
#include "register/verdict/pose_examiner.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "base/error.h"
#include "base/sample_summary.h"

namespace af::registration {
namespace {

/// Robust gradients are of no use within silhouettes: the grain of the bone and of the detector,
/// which counts there like an edge, hides what the bone's edges explain.
StageOptions silhouette_stage(double silhouette_mm) {
  StageOptions stage;
  stage.similarity.name = "gc";
  stage.level = 1;
  stage.pixel_step = 4;
  stage.silhouette_mm = silhouette_mm;
  return stage;
}

/// The squared correlation.
double share_of(double correlation) {
  return std::isfinite(correlation) ? std::pow(std::max(0.0, correlation), 2) : correlation;
}

/// Places in judging_stages().
constexpr std::size_t kCoarse = 0;
constexpr std::size_t kFine = 1;

/// Two stages, to be evaluated only: the judge's at the coarsest level that the view has up to its
/// own, and at level 0.
std::array<StageOptions, 2> judging_stages(const RegistrationView& view, double silhouette_mm) {
  StageOptions stage = silhouette_mm > 0.0 ? silhouette_stage(silhouette_mm) : JudgeOptions().stage;
  stage.optimizer = "gauss-newton";
  StageOptions fine = stage;
  stage.level = std::min(stage.level, static_cast<int>(view.coarse_levels.size()));
  fine.level = 0;
  return {stage, fine};
}

}  // namespace

/// None when the X-ray has no gradients over most of the region: the measure refuses it.
std::optional<PoseExaminer::JudgedView> PoseExaminer::judged_view(
    const RegistrationProblem& problem, std::size_t view, double silhouette_mm) {
  JudgedView judged{problem, {}};
  judged.alone.views = {problem.views[view]};
  try {
    judged.stages =
        prepared_stages(judged.alone, judging_stages(problem.views[view], silhouette_mm), nullptr);
  } catch (const InputError&) {
    return std::nullopt;
  }
  return judged;
}

double PoseExaminer::JudgedView::share_at(std::size_t stage, const RigidTransform& room_from_ct) {
  const double value = stages[stage].value_at(alone, room_from_ct).similarity;
  return stages[stage].silhouettes.empty() ? value : share_of(value);
}

double PoseExaminer::JudgedView::share_beside(const RigidTransform& room_from_ct, double mm) {
  const CameraGeometry& camera = alone.views.front().view.camera;
  const PoseFrame frame = PoseFrame::about(room_from_ct, alone.center_ct_mm);
  std::vector<double> shares;
  for (const Eigen::Vector3d& direction : {camera.column_direction, camera.row_direction})
    for (const double way_mm : {-mm, mm}) {
      const RigidTransform beside =
          pose_from_parameters(frame, {.translation_mm = way_mm * direction});
      const double share = share_at(kFine, beside);
      if (std::isfinite(share)) shares.push_back(share);
    }
  return mean_of(shares);
}

int PoseExaminer::coarsest_level() {
  return JudgeOptions().stage.level;
}

PoseExaminer::PoseExaminer(const RegistrationProblem& problem, double silhouette_mm)
    : in_silhouette_(silhouette_mm > 0.0) {
  for (std::size_t i = 0; i < problem.views.size(); ++i)
    views_.push_back(judged_view(problem, i, silhouette_mm));
}

std::vector<ViewValue> PoseExaminer::view_values(const RigidTransform& room_from_ct,
                                                 bool with_backgrounds) {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  std::vector<ViewValue> values;
  for (std::optional<JudgedView>& view : views_) {
    ViewValue& value = values.emplace_back(ViewValue{kNone, kNone, in_silhouette_});
    if (!view) continue;
    value.coarse = view->share_at(kCoarse, room_from_ct);
    value.fine = view->share_at(kFine, room_from_ct);
    if (!with_backgrounds) continue;
    for (const double part : {1.0, 0.5, 0.25}) {
      value.background = view->share_beside(room_from_ct, part * kBackgroundDistanceMm);
      if (std::isfinite(value.background)) break;
    }
  }
  return values;
}

}  // namespace af::registration
