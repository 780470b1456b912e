// SPDX-License-Identifier: Apache-2.0
#include "ct/ray_slopes.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>
#include <Eigen/LU>

namespace af {

namespace {

Eigen::Vector3d across(const Eigen::Vector3d& force, const Eigen::Vector3d& direction) {
  return force - force.dot(direction) * direction;
}

/// How far the end of a path moves along the ray, as a force: by itself, or until it is on its face
/// again.
Eigen::Vector3d slide(const Eigen::Vector3d& direction, int axis) {
  if (axis == RayPath::kNoFace) return direction;
  // A ray along a face would slide without end.
  constexpr double kLeastCosine = 1e-2;
  const double cosine =
      std::copysign(std::max(std::abs(direction[axis]), kLeastCosine), direction[axis]);
  return across(-Eigen::Vector3d::Unit(axis) / cosine, direction);
}

}  // namespace

RayMechanics::RayMechanics(const CtGrid& grid, const MotionSlopes& motions)
    : pivot_(grid.direction.transpose() * (motions.pivot_ct_point - grid.origin_mm)),
      axes_(grid.direction.transpose() * motions.ct_axes),
      handedness_(grid.direction.determinant() < 0.0 ? -1.0 : 1.0) {}

std::array<float, 6> RayMechanics::slopes_of(const RayPath& path, const RaySums& sums) const {
  if (path.samples == 0) return {};
  const Eigen::Vector3d way = path.end - path.begin;
  const Eigen::Vector3d direction = way.normalized();
  const Eigen::Vector3d at_end = (sums.numbered_slopes + 0.5 * sums.slopes) / path.samples;
  const Eigen::Vector3d begin_force = across(sums.slopes - at_end, direction) +
                                      sums.stretched_begin * slide(direction, path.begin_axis);
  const Eigen::Vector3d end_force =
      across(at_end, direction) + sums.stretched_end * slide(direction, path.end_axis);
  const Eigen::Vector3d moment =
      (path.begin - pivot_).cross(begin_force) + (path.end - pivot_).cross(end_force);
  const Eigen::Vector3d rotation = -handedness_ * (axes_.transpose() * moment);
  const Eigen::Vector3d translation = -axes_.transpose() * (begin_force + end_force);
  std::array<float, 6> slopes{};
  for (Eigen::Index i = 0; i < 3; ++i) {
    slopes[static_cast<std::size_t>(i)] = static_cast<float>(rotation[i]);
    slopes[static_cast<std::size_t>(3 + i)] = static_cast<float>(translation[i]);
  }
  return slopes;
}

}  // namespace af
