// SPDX-License-Identifier: Apache-2.0
#include "register/verdict/target_examiner.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "base/error.h"
#include "drr/part_motion_drr.h"
#include "geometry/target_box.h"
#include "register/method/prepared_stage.h"
#include "register/problem/pose_target.h"
#include "register/problem/target_region.h"

namespace af::registration {
namespace {

/// Margin around the target's shadow, at the isocentre: room for a target that has moved.
constexpr double kMarginMm = 5.0;
/// Side of the pixels to compare, likewise.
constexpr double kPixelMm = 1.5;
/// At level 0 every node of a field would show.
constexpr int kLevel = 1;
/// A target that has not moved takes three. One that shows little may wander.
constexpr int kMostEvaluations = 50;

/// The region of the target's shadow at a pose, with its margin, on the detector. None where it is
/// empty.
std::optional<RegionOfInterest> shadow_of(const CtBox& box_ct,
                                          const CameraGeometry& camera,
                                          const RigidTransform& room_from_ct,
                                          double margin_px) {
  const auto box = projected_box(box_ct, room_from_ct, camera);
  if (!box) return std::nullopt;
  const Eigen::Array2d last_px = camera.size_px.cast<double>().array() - 1.0;
  const Eigen::Array2i low =
      (box->low_px.array() - margin_px).floor().max(0.0).min(last_px).cast<int>();
  const Eigen::Array2i high =
      (box->high_px.array() + margin_px).ceil().max(0.0).min(last_px).cast<int>();
  if ((high <= low).any()) return std::nullopt;
  return RegionOfInterest{low.x(), low.y(), high.x() - low.x() + 1, high.y() - low.y() + 1};
}

/// The target as the only body that moves, seen in its shadow.
struct TargetAlone {
  RegistrationProblem problem;
  std::vector<std::shared_ptr<PartMotionDrr>> drrs;  ///< one per view
  StageOptions stage;
};

StageOptions stage_for(const RegistrationProblem& problem) {
  StageOptions stage;
  stage.similarity = JudgeOptions().stage.similarity;
  stage.level = kLevel;
  stage.optimizer = "gauss-newton";
  stage.search.initial_step_mm = 3.0;
  stage.search.final_step_mm = 0.02;
  double px_per_mm = problem.views.front().view.camera.pixels_per_mm(problem.isocenter_point);
  for (const RegistrationView& view : problem.views) {
    px_per_mm = std::min(px_per_mm, view.view.camera.pixels_per_mm(problem.isocenter_point));
    stage.level = std::min({stage.level,
                            static_cast<int>(view.coarse_levels.size()),
                            static_cast<int>(view.target_casts.size()) - 1});
  }
  stage.pixel_step = std::max(1, static_cast<int>(std::lround(kPixelMm * px_per_mm)));
  return stage;
}

std::optional<TargetAlone> target_alone(const RegistrationProblem& whole,
                                        const RigidTransform& room_from_ct) {
  TargetAlone alone{{}, {}, stage_for(whole)};
  if (alone.stage.level < 0 || !whole.target_box_ct || whole.target_points_ct.empty())
    return std::nullopt;
  RegistrationProblem& problem = alone.problem;
  problem.nominal_room_from_ct = room_from_ct;
  problem.center_ct_mm = mean_point(whole.target_points_ct);
  problem.isocenter_point = whole.isocenter_point;
  problem.scaling_points_ct = whole.target_points_ct;
  for (const RegistrationView& view : whole.views) {
    const double px_per_mm = view.view.camera.pixels_per_mm(whole.isocenter_point);
    const auto region =
        shadow_of(*whole.target_box_ct, view.view.camera, room_from_ct, kMarginMm * px_per_mm);
    if (!region) return std::nullopt;
    RegistrationView& seen = problem.views.emplace_back(view);
    seen.view.roi = *region;
    seen.target_region.reset();
    seen.limit.reset();
    if (!seen.drr_range) seen.drr_range = drr_range_of(whole, view);
    const auto level = static_cast<std::size_t>(alone.stage.level);
    auto& renderer = level == 0 ? seen.renderer : seen.coarse_levels[level - 1].renderer;
    alone.drrs.push_back(std::make_shared<PartMotionDrr>(renderer, view.target_casts[level]));
    renderer = alone.drrs.back();
  }
  return alone;
}

/// The stage's value for the rest alone, with the target where no view sees it.
double value_without_target(MultiViewObjective& objective, const RigidTransform& room_from_ct) {
  constexpr double kOutOfSightMm = 1e5;
  const CameraGeometry& camera = objective.views().front().view.camera;
  RigidTransform away = room_from_ct;
  away.pretranslate(kOutOfSightMm * (camera.column_direction + camera.row_direction));
  return objective.evaluate(away).similarity;
}

std::optional<TargetAnswer> answer_of(PreparedStage& stage, const TargetAlone& alone) {
  const RigidTransform& pose = alone.problem.nominal_room_from_ct;
  for (std::size_t i = 0; i < alone.drrs.size(); ++i)
    if (!alone.drrs[i]->hold(pose, stage.objective.views()[i].view).is_inside())
      return std::nullopt;
  const auto scaling = projected_motion_scaling(pose,
                                                alone.problem.center_ct_mm,
                                                alone.problem.scaling_points_ct,
                                                views_at(alone.problem, pose),
                                                alone.problem.isocenter_point);
  if (!scaling) return std::nullopt;
  PoseTarget target(stage.objective, PoseFrame::about(pose, alone.problem.center_ct_mm), *scaling);
  const double with_target = stage.objective.evaluate(pose).similarity;
  const double without_target = value_without_target(stage.objective, pose);
  OptimizerResult found;
  stage.optimizer->maximize(target, stage.options.search, {kMostEvaluations, 0}, found);
  return TargetAnswer{with_target > 0.0 ? std::max(0.0, 1.0 - without_target / with_target) : 0.0,
                      target.pose(found.point)};
}

std::optional<TargetAnswer> answer_at(const RegistrationProblem& whole,
                                      const RigidTransform& room_from_ct,
                                      const std::shared_ptr<ThreadPool>& threads) {
  const std::optional<TargetAlone> alone = target_alone(whole, room_from_ct);
  if (!alone) return std::nullopt;
  try {
    std::vector<PreparedStage> stages =
        prepared_stages(alone->problem, alone->problem.views, {&alone->stage, 1}, threads);
    return answer_of(stages.front(), *alone);
  } catch (const InputError&) {
    // The X-ray has no gradients over most of the shadow.
    return std::nullopt;
  }
}

}  // namespace

TargetExaminer::TargetExaminer(std::shared_ptr<const RegistrationProblem> problem,
                               std::shared_ptr<ThreadPool> threads)
    : problem_(std::move(problem)), threads_(std::move(threads)) {}

TargetEvidence TargetExaminer::evidence(const RigidTransform& room_from_ct) {
  constexpr double kTurnRad = 1e-3;
  constexpr double kMoveMm = 0.1;
  const PoseFrame frame = problem_->frame();
  PoseParameters held = parameters_from_pose(frame, room_from_ct);
  LatticePose place{};
  for (Eigen::Index i = 0; i < 3; ++i) {
    const auto at = static_cast<std::size_t>(i);
    place[at] = std::llround(held.rotation_rad[i] / kTurnRad);
    place[at + 3] = std::llround(held.translation_mm[i] / kMoveMm);
    held.rotation_rad[i] = kTurnRad * static_cast<double>(place[at]);
    held.translation_mm[i] = kMoveMm * static_cast<double>(place[at + 3]);
  }
  auto known = answers_.find(place);
  if (known == answers_.end())
    known =
        answers_.emplace(place, answer_at(*problem_, pose_from_parameters(frame, held), threads_))
            .first;
  const std::optional<TargetAnswer>& answer = known->second;
  if (!answer) return {TargetEvidence::kNone, TargetEvidence::kNone, true};
  return {
      answer->share,
      across_beam_mm(*problem_, problem_->target_points_ct, room_from_ct, answer->room_from_ct)};
}

}  // namespace af::registration
