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
    : in_silhouette_(silhouette_mm > 0.0) {
  for (std::size_t i = 0; i < problem.views.size(); ++i)
    views_.push_back(judge_of(problem, i, silhouette_mm));
}

std::vector<ViewValue> PoseExaminer::view_values(const RigidTransform& room_from_ct) {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  std::vector<ViewValue> values;
  for (const auto& view : views_) {
    values.push_back({kNone, kNone, in_silhouette_});
    if (!view) continue;
    values.back().coarse = view->similarity_at(room_from_ct, 0).similarity;
    values.back().fine = view->similarity_at(room_from_ct, 1).similarity;
    if (!in_silhouette_) continue;
    values.back().coarse = share_of(values.back().coarse);
    values.back().fine = share_of(values.back().fine);
  }
  return values;
}

}  // namespace af::registration
