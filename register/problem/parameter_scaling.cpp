// SPDX-License-Identifier: Apache-2.0
#include "register/problem/parameter_scaling.h"

#include "geometry/point_projector.h"

namespace af::registration {
namespace {

/// A parameter that moves projections by less than this (for example a translation along the only
/// view's beam) is scaled as if it moved them by this much, which keeps its steps finite.
constexpr double kSmallestDisplacementMm = 1e-3;

bool projects_into(const PointProjector& projector,
                   const RegionOfInterest& roi,
                   const Eigen::Vector3d& room_point) {
  if (!(projector.depth_mm(room_point) > 0.0)) return false;
  const Eigen::Vector2d pixel = projector.project(room_point);
  return pixel.x() >= roi.column - 0.5 && pixel.x() < roi.column + roi.width - 0.5 &&
         pixel.y() >= roi.row - 0.5 && pixel.y() < roi.row + roi.height - 0.5;
}

/// Lengths of the image velocities on the isocentre plane of a point that moves by each parameter.
ScaledParameters image_speeds(const PointProjector& projector,
                              const Eigen::Vector3d& room_point,
                              const Eigen::Vector3d& center_room_point,
                              double isocenter_depth_mm) {
  const Eigen::Vector3d& beam = projector.beam_direction();
  const Eigen::Vector3d from_source = room_point - projector.camera().source_point;
  const double depth = beam.dot(from_source);
  const Eigen::Vector3d arm = room_point - center_room_point;
  ScaledParameters speeds;
  for (int axis = 0; axis < 3; ++axis) {
    const Eigen::Vector3d unit = Eigen::Vector3d::Unit(axis);
    const auto speed = [&](const Eigen::Vector3d& velocity) {
      return (velocity - from_source * (beam.dot(velocity) / depth)).norm() * isocenter_depth_mm /
             depth;
    };
    speeds[axis] = speed(unit.cross(arm));
    speeds[axis + 3] = speed(unit);
  }
  return speeds;
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
  const Eigen::Vector3d center_room_point = room_from_ct * center_ct_mm;
  std::vector<PointProjector> projectors;
  for (const View& view : views) projectors.emplace_back(view.camera);
  ScaledParameters sums = ScaledParameters::Zero();
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
      sums +=
          image_speeds(projector, point, center_room_point, projector.depth_mm(isocenter_point));
      ++count;
    }
  }
  if (count == 0) return std::nullopt;
  ParameterScaling scaling;
  scaling.displacement_mm = (sums / static_cast<double>(count)).cwiseMax(kSmallestDisplacementMm);
  return scaling;
}

}  // namespace af::registration
