// SPDX-License-Identifier: Apache-2.0
#include "register/verdict/pose_examiner.h"

#include <algorithm>
#include <limits>

#include "base/error.h"

namespace af::registration {
namespace {

/// Two stages, to be evaluated only: the judge's at the coarsest level that the view has up to its
/// own, and at level 0.
RegistrationOptions judging_options(const RegistrationView& view) {
  RegistrationOptions options;
  StageOptions stage = options.judge.stage;
  stage.optimizer = "gauss-newton";
  StageOptions fine = stage;
  stage.level = std::min(stage.level, static_cast<int>(view.coarse_levels.size()));
  fine.level = 0;
  options.chains = {{"judge", {stage, fine}}};
  return options;
}

/// None when the X-ray has no gradients over most of the region: the measure refuses it.
std::unique_ptr<RegistrationRunner> judge_of(const RegistrationProblem& problem, std::size_t view) {
  const auto alone = std::make_shared<RegistrationProblem>(problem);
  alone->views = {problem.views[view]};
  try {
    return std::make_unique<RegistrationRunner>(alone, judging_options(problem.views[view]));
  } catch (const InputError&) {
    return nullptr;
  }
}

}  // namespace

int PoseExaminer::coarsest_level() {
  return RegistrationOptions().judge.stage.level;
}

PoseExaminer::PoseExaminer(std::shared_ptr<const RegistrationProblem> problem) {
  for (std::size_t i = 0; i < problem->views.size(); ++i) views_.push_back(judge_of(*problem, i));
}

std::vector<ViewValue> PoseExaminer::view_values(const RigidTransform& room_from_ct) {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  std::vector<ViewValue> values;
  for (const auto& view : views_) {
    values.push_back({kNone, kNone});
    if (!view) continue;
    values.back() = {view->similarity_at(room_from_ct, 0).similarity,
                     view->similarity_at(room_from_ct, 1).similarity};
  }
  return values;
}

}  // namespace af::registration
