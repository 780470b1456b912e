// SPDX-License-Identifier: Apache-2.0
#include "register/verdict/pose_examiner.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.h"

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

}  // namespace

int PoseExaminer::coarsest_level() {
  return JudgeOptions().stage.level;
}

PoseExaminer::PoseExaminer(const RegistrationProblem& problem, double silhouette_mm)
    : in_silhouette_(silhouette_mm > 0.0), center_ct_mm_(problem.center_ct_mm) {
  for (std::size_t i = 0; i < problem.views.size(); ++i) {
    cameras_.push_back(problem.views[i].view.camera);
    views_.push_back(judge_of(problem, i, silhouette_mm));
  }
}

double PoseExaminer::fine_value(std::size_t view, const RigidTransform& room_from_ct) {
  const double value = views_[view]->similarity_at(room_from_ct, 1).similarity;
  return in_silhouette_ ? share_of(value) : value;
}

std::vector<ViewValue> PoseExaminer::view_values(const RigidTransform& room_from_ct) {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  std::vector<ViewValue> values;
  for (std::size_t i = 0; i < views_.size(); ++i) {
    values.push_back({kNone, kNone, in_silhouette_});
    if (!views_[i]) continue;
    const double coarse = views_[i]->similarity_at(room_from_ct, 0).similarity;
    values.back().coarse = in_silhouette_ ? share_of(coarse) : coarse;
    values.back().fine = fine_value(i, room_from_ct);
  }
  return values;
}

void PoseExaminer::add_backgrounds(const RigidTransform& room_from_ct,
                                   std::vector<ViewValue>& values) {
  const PoseFrame frame = PoseFrame::about(room_from_ct, center_ct_mm_);
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (!views_[i]) continue;
    double sum = 0.0;
    int count = 0;
    for (double mm = kBackgroundDistanceMm; count == 0 && mm >= kBackgroundDistanceMm / 4; mm /= 2)
      for (const Eigen::Vector3d& axis : {cameras_[i].column_direction, cameras_[i].row_direction})
        for (const double way : {-mm, mm}) {
          const double value =
              fine_value(i, pose_from_parameters(frame, {.translation_mm = way * axis}));
          if (!std::isfinite(value)) continue;
          sum += value;
          ++count;
        }
    if (count > 0) values[i].background = sum / count;
  }
}

}  // namespace af::registration
