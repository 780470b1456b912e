// SPDX-License-Identifier: Apache-2.0
#include "register/problem/pose_target.h"

#include <utility>

namespace af::registration {
namespace {

/// Poses keep this share of a box's size away from its edge, so that rounding does not put them
/// beyond it.
constexpr double kInsideShare = 1e-9;

/// The pose of a motion limit's box nearest to `room_from_ct`, parameter by parameter.
RigidTransform clamped_pose(const MotionLimit& limit, const RigidTransform& room_from_ct) {
  const PoseParameters parameters = parameters_from_pose(limit.frame, room_from_ct);
  return pose_from_parameters(limit.frame, limit.range.clamped(parameters, 1.0 - kInsideShare));
}

}  // namespace

PoseTarget::PoseTarget(MultiViewObjective& objective,
                       PoseFrame frame,
                       const ParameterScaling& scaling)
    : objective_(objective), frame_(std::move(frame)), scaling_(scaling) {}

RigidTransform PoseTarget::pose(const ScaledParameters& point) const {
  return pose_from_parameters(frame_, scaling_.unscaled(point));
}

void PoseTarget::count(const ObjectiveValue& value) {
  drr_count_ += value.drr_count;
  rays_outside_ = value.rays_outside;
}

ScaledParameters PoseTarget::nearest_admissible(const ScaledParameters& point) const {
  RigidTransform nearest = pose(point);
  bool is_changed = false;
  for (const ObjectiveView& view : objective_.views()) {
    if (!view.limit.has_value() ||
        view.limit->range.contains(parameters_from_pose(view.limit->frame, nearest)))
      continue;
    nearest = clamped_pose(*view.limit, nearest);
    is_changed = true;
  }
  if (!is_changed) return point;
  const PoseParameters parameters = parameters_from_pose(frame_, nearest);
  ScaledParameters result;
  result << parameters.rotation_rad, parameters.translation_mm;
  return result.cwiseProduct(scaling_.displacement_mm);
}

std::optional<double> PoseTarget::evaluate(const ScaledParameters& point) {
  const ObjectiveValue value = objective_.evaluate(pose(point));
  count(value);
  if (!value.is_admissible) return std::nullopt;
  return value.similarity;
}

void PoseTarget::evaluate_all(std::span<const ScaledParameters> points,
                              std::span<std::optional<double>> values) {
  poses_.clear();
  for (const ScaledParameters& point : points) poses_.push_back(pose(point));
  values_.assign(points.size(), {});
  objective_.evaluate_all(poses_, values_);
  for (std::size_t i = 0; i < points.size(); ++i) {
    count(values_[i]);
    values[i] = values_[i].is_admissible ? std::optional(values_[i].similarity) : std::nullopt;
  }
}

std::optional<TargetValue> PoseTarget::evaluate_with(const ScaledParameters& point,
                                                     Derivatives derivatives) {
  const PoseParameters parameters = scaling_.unscaled(point);
  const Eigen::Vector3d pivot = frame_.center_room_mm + parameters.translation_mm;
  NormalEquations equations;
  const ObjectiveValue value = objective_.evaluate_with(
      pose_from_parameters(frame_, parameters), pivot, derivatives, equations);
  count(value);
  if (!value.is_admissible) return std::nullopt;
  PoseMatrix motions = motions_from_parameters(parameters);
  for (int k = 0; k < 6; ++k) motions.col(k) /= scaling_.displacement_mm[k];
  return TargetValue{equations.value,
                     motions.transpose() * equations.gradient,
                     motions.transpose() * equations.matrix * motions};
}

}  // namespace af::registration
