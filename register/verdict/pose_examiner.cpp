// SPDX-License-Identifier: Apache-2.0
#include "register/verdict/pose_examiner.h"

#include <algorithm>
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

/// Places in judging_options().
constexpr std::size_t kCoarse = 0;
constexpr std::size_t kFine = 1;

/// Two stages, to be evaluated only: the judge's at the coarsest level that the view has up to its
/// own, and at level 0.
RegistrationOptions judging_options(const RegistrationView& view, double silhouette_mm) {
  RegistrationOptions options;
  StageOptions stage = silhouette_mm > 0.0 ? silhouette_stage(silhouette_mm) : JudgeOptions().stage;
  stage.optimizer = "gauss-newton";
  StageOptions fine = stage;
  stage.level = std::min(stage.level, static_cast<int>(view.coarse_levels.size()));
  fine.level = 0;
  options.chains = {{"judge", {stage, fine}}};
  return options;
}

/// None when the X-ray has no gradients over most of the region: the measure refuses it.
std::unique_ptr<RegistrationRunner> judge_of(const RegistrationProblem& problem,
                                             std::size_t view,
                                             double silhouette_mm) {
  const auto alone = std::make_shared<RegistrationProblem>(problem);
  alone->views = {problem.views[view]};
  try {
    return std::make_unique<RegistrationRunner>(
        alone, judging_options(problem.views[view], silhouette_mm));
  } catch (const InputError&) {
    return nullptr;
  }
}

double share_at(RegistrationRunner& view,
                std::size_t stage,
                const RigidTransform& room_from_ct,
                bool in_silhouette) {
  const double value = view.similarity_at(room_from_ct, stage).similarity;
  return in_silhouette ? share_of(value) : value;
}

/// Mean share in detail over the poses that the field holds of four `mm` beside one; NaN for none.
double share_beside(RegistrationRunner& view,
                    const RigidTransform& room_from_ct,
                    double mm,
                    bool in_silhouette) {
  const RegistrationProblem& problem = view.problem();
  const CameraGeometry& camera = problem.views.front().view.camera;
  const PoseFrame frame = PoseFrame::about(room_from_ct, problem.center_ct_mm);
  std::vector<double> shares;
  for (const Eigen::Vector3d& direction : {camera.column_direction, camera.row_direction})
    for (const double way_mm : {-mm, mm}) {
      const RigidTransform beside =
          pose_from_parameters(frame, {.translation_mm = way_mm * direction});
      const double share = share_at(view, kFine, beside, in_silhouette);
      if (std::isfinite(share)) shares.push_back(share);
    }
  return mean_of(shares);
}

}  // namespace

int PoseExaminer::coarsest_level() {
  return JudgeOptions().stage.level;
}

PoseExaminer::PoseExaminer(const RegistrationProblem& problem, double silhouette_mm)
    : in_silhouette_(silhouette_mm > 0.0) {
  for (std::size_t i = 0; i < problem.views.size(); ++i)
    views_.push_back(judge_of(problem, i, silhouette_mm));
}

std::vector<ViewValue> PoseExaminer::view_values(const RigidTransform& room_from_ct,
                                                 bool with_backgrounds) {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  std::vector<ViewValue> values;
  for (const auto& view : views_) {
    ViewValue& value = values.emplace_back(ViewValue{kNone, kNone, in_silhouette_});
    if (!view) continue;
    value.coarse = share_at(*view, kCoarse, room_from_ct, in_silhouette_);
    value.fine = share_at(*view, kFine, room_from_ct, in_silhouette_);
    if (!with_backgrounds) continue;
    for (const double part : {1.0, 0.5, 0.25}) {
      value.background =
          share_beside(*view, room_from_ct, part * kBackgroundDistanceMm, in_silhouette_);
      if (std::isfinite(value.background)) break;
    }
  }
  return values;
}

}  // namespace af::registration
