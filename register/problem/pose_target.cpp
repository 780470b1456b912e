// SPDX-License-Identifier: Apache-2.0
#include "register/problem/pose_target.h"

#include <utility>

#include <Eigen/Eigenvalues>

#include "geometry/point_projector.h"
#include "register/optimizer/curvature_bounds.h"

namespace af::registration {
namespace {

/// A parameter that moves projections by less than this (for example a translation along the only
/// view's beam) is scaled as if it moved them by this much. That keeps its steps finite.
constexpr double kSmallestDisplacementMm = 1e-3;

/// Likewise, motions that move projections by less than this (in squares that are 1 for single
/// parameters) count as moving them by this much.
constexpr double kLeastEigenvalue = 1e-6;

/// Where measures that reweight their residuals curve by less than this share of what their normal
/// equations say, searches assume this share.
constexpr double kLeastShareOfNormalEquations = 0.03;

bool projects_into(const PointProjector& projector,
                   const RegionOfInterest& roi,
                   const Eigen::Vector3d& room_point) {
  if (!(projector.depth_mm(room_point) > 0.0)) return false;
  const Eigen::Vector2d pixel = projector.project(room_point);
  return pixel.x() >= roi.column - 0.5 && pixel.x() < roi.column + roi.width - 0.5 &&
         pixel.y() >= roi.row - 0.5 && pixel.y() < roi.row + roi.height - 0.5;
}

using ImageVelocities = Eigen::Matrix<double, 3, 6>;

/// The image velocities (room axes) on the isocentre plane of a point that moves by each parameter.
ImageVelocities image_velocities(const PointProjector& projector,
                                 const Eigen::Vector3d& room_point,
                                 const Eigen::Vector3d& center_room_point,
                                 double isocenter_depth_mm) {
  const Eigen::Vector3d& beam = projector.beam_direction();
  const Eigen::Vector3d from_source = room_point - projector.camera().source_point;
  const double depth = beam.dot(from_source);
  const Eigen::Vector3d arm = room_point - center_room_point;
  ImageVelocities velocities;
  for (int axis = 0; axis < 3; ++axis) {
    const Eigen::Vector3d unit = Eigen::Vector3d::Unit(axis);
    const auto in_image = [&](const Eigen::Vector3d& velocity) -> Eigen::Vector3d {
      return (velocity - from_source * (beam.dot(velocity) / depth)) * isocenter_depth_mm / depth;
    };
    velocities.col(axis) = in_image(unit.cross(arm));
    velocities.col(axis + 3) = in_image(unit);
  }
  return velocities;
}

/// Calls add(velocities) for every view and every point that projects into the region of at least
/// one. Returns how often.
template <typename Add>
std::size_t for_each_velocity(const RigidTransform& room_from_ct,
                              const Eigen::Vector3d& center_ct_mm,
                              std::span<const Eigen::Vector3d> points_ct,
                              std::span<const View> views,
                              const Eigen::Vector3d& isocenter_point,
                              const Add& add) {
  const Eigen::Vector3d center_room_point = room_from_ct * center_ct_mm;
  std::vector<PointProjector> projectors;
  for (const View& view : views) projectors.emplace_back(view.camera);
  std::size_t count = 0;
  for (const Eigen::Vector3d& ct_point : points_ct) {
    const Eigen::Vector3d point = room_from_ct * ct_point;
    bool is_seen = false;
    for (std::size_t i = 0; i < views.size() && !is_seen; ++i)
      is_seen = projects_into(projectors[i], views[i].roi, point);
    if (!is_seen) continue;
    for (const PointProjector& projector : projectors) {
      // For another view, a point beside its source has no image.
      if (!(projector.depth_mm(point) > 0.0)) continue;
      add(image_velocities(
          projector, point, center_room_point, projector.depth_mm(isocenter_point)));
      ++count;
    }
  }
  return count;
}

std::vector<Eigen::Vector3d> cell_centers(int points_per_axis) {
  std::vector<Eigen::Vector3d> fractions;
  const auto n = static_cast<std::size_t>(points_per_axis);
  fractions.reserve(n * n * n);
  const auto at = [&](int i) { return (i + 0.5) / points_per_axis; };
  for (int k = 0; k < points_per_axis; ++k)
    for (int j = 0; j < points_per_axis; ++j)
      for (int i = 0; i < points_per_axis; ++i) fractions.emplace_back(at(i), at(j), at(k));
  return fractions;
}

}  // namespace

PoseParameters ParameterScaling::unscaled(const ScaledParameters& point) const {
  const ScaledParameters values = point.cwiseQuotient(displacement_mm);
  return {values.head<3>(), values.tail<3>()};
}

std::vector<Eigen::Vector3d> ct_lattice_points(const CtGrid& grid, int points_per_axis) {
  std::vector<Eigen::Vector3d> points = cell_centers(points_per_axis);
  const Eigen::Vector3d size(grid.size[0], grid.size[1], grid.size[2]);
  for (Eigen::Vector3d& point : points)
    point = grid.point_mm(point.cwiseProduct(size) - Eigen::Vector3d::Constant(0.5));
  return points;
}

std::vector<Eigen::Vector3d> ct_lattice_points(const CtBox& box, int points_per_axis) {
  std::vector<Eigen::Vector3d> points = cell_centers(points_per_axis);
  for (Eigen::Vector3d& point : points)
    point = box.low_mm + point.cwiseProduct(box.high_mm - box.low_mm);
  return points;
}

std::optional<ParameterScaling> projected_motion_scaling(const RigidTransform& room_from_ct,
                                                         const Eigen::Vector3d& center_ct_mm,
                                                         std::span<const Eigen::Vector3d> points_ct,
                                                         std::span<const View> views,
                                                         const Eigen::Vector3d& isocenter_point) {
  ScaledParameters sums = ScaledParameters::Zero();
  const std::size_t count = for_each_velocity(
      room_from_ct,
      center_ct_mm,
      points_ct,
      views,
      isocenter_point,
      [&](const ImageVelocities& velocities) { sums += velocities.colwise().norm().transpose(); });
  if (count == 0) return std::nullopt;
  ParameterScaling scaling;
  scaling.displacement_mm = (sums / static_cast<double>(count)).cwiseMax(kSmallestDisplacementMm);
  return scaling;
}

std::optional<PoseMatrix> projected_motion_basis(const RigidTransform& room_from_ct,
                                                 const Eigen::Vector3d& center_ct_mm,
                                                 std::span<const Eigen::Vector3d> points_ct,
                                                 std::span<const View> views,
                                                 const Eigen::Vector3d& isocenter_point) {
  PoseMatrix squares = PoseMatrix::Zero();
  const std::size_t count = for_each_velocity(
      room_from_ct,
      center_ct_mm,
      points_ct,
      views,
      isocenter_point,
      [&](const ImageVelocities& velocities) { squares += velocities.transpose() * velocities; });
  if (count == 0) return std::nullopt;
  squares /= static_cast<double>(count);
  const PoseVector sizes = squares.diagonal().cwiseSqrt().cwiseMax(kSmallestDisplacementMm);
  // Parameters are brought to like size, so that eigenvectors do not depend on units.
  const PoseMatrix alike =
      sizes.cwiseInverse().asDiagonal() * squares * sizes.cwiseInverse().asDiagonal();
  const Eigen::SelfAdjointEigenSolver<PoseMatrix> solver(alike);
  const PoseVector lengths = solver.eigenvalues().cwiseMax(kLeastEigenvalue).cwiseSqrt();
  return sizes.cwiseInverse().asDiagonal() * solver.eigenvectors() *
         lengths.cwiseInverse().asDiagonal();
}

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
  const RigidTransform wanted = pose(point);
  if (objective_.beyond_limits(wanted).none()) return point;
  const PoseParameters parameters =
      parameters_from_pose(frame_, objective_.nearest_within_limits(wanted));
  ScaledParameters result;
  result << parameters.rotation_rad, parameters.translation_mm;
  return result.cwiseProduct(scaling_.displacement_mm);
}

ParameterSet PoseTarget::limits_at(const ScaledParameters& point, double step_mm) const {
  ParameterSet found;
  for (const ScaledParameters& neighbor : neighbors(point, step_mm))
    found |= objective_.beyond_limits(pose(neighbor));
  return found;
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
  TargetValue target{equations.value,
                     motions.transpose() * equations.gradient,
                     motions.transpose() * equations.matrix * motions};
  if (!equations.reweighting.isZero(0.0))
    target.matrix =
        kept_between(target.matrix - motions.transpose() * equations.reweighting * motions,
                     target.matrix,
                     kLeastShareOfNormalEquations,
                     1.0);
  return target;
}

}  // namespace af::registration
