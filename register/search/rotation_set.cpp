// SPDX-License-Identifier: Apache-2.0
#include "register/search/rotation_set.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>

#include "geometry/rigid_transform.h"

namespace af::registration {
namespace {

/// The 24 rotations of a cube: signed permutations of the axes with determinant 1.
std::vector<Eigen::Matrix3d> cube_rotations() {
  std::vector<Eigen::Matrix3d> rotations;
  std::array<int, 3> order{0, 1, 2};
  do {
    for (unsigned signs = 0; signs < 8; ++signs) {
      Eigen::Matrix3d rotation = Eigen::Matrix3d::Zero();
      for (int axis = 0; axis < 3; ++axis)
        rotation(axis, order[static_cast<std::size_t>(axis)]) =
            (signs >> axis & 1U) != 0 ? -1.0 : 1.0;
      if (rotation.determinant() > 0.0) rotations.push_back(rotation);
    }
  } while (std::next_permutation(order.begin(), order.end()));
  return rotations;
}

/// Middles of cells no wider than `step` that divide [low, high].
std::vector<double> cell_middles(double low, double high, double step) {
  const int count = std::max(1, static_cast<int>(std::ceil((high - low) / step - 1e-9)));
  std::vector<double> middles;
  for (int i = 0; i < count; ++i) middles.push_back(low + (high - low) * (i + 0.5) / count);
  return middles;
}

/// Whether no other rotation of the cube is nearer than none. A trace is 1 + 2 cos(angle).
bool is_nearest_to_identity(const Eigen::Matrix3d& rotation,
                            const std::vector<Eigen::Matrix3d>& cube) {
  return std::all_of(cube.begin(), cube.end(), [&](const Eigen::Matrix3d& other) {
    return (other.transpose() * rotation).trace() <= rotation.trace() + 1e-9;
  });
}

}  // namespace

std::vector<Eigen::Matrix3d> rotations_of_range(const MotionRange& range, double step_rad) {
  const Eigen::Vector3d& low = range.low.rotation_rad;
  const Eigen::Vector3d& high = range.high.rotation_rad;
  std::vector<Eigen::Matrix3d> rotations;
  for (const double x : cell_middles(low.x(), high.x(), step_rad))
    for (const double y : cell_middles(low.y(), high.y(), step_rad))
      for (const double z : cell_middles(low.z(), high.z(), step_rad))
        rotations.push_back(rotation_from_angles({x, y, z}));
  return rotations;
}

std::bitset<3> in_outer_cells(const MotionRange& range,
                              double step_rad,
                              const Eigen::Vector3d& rotation_rad) {
  std::bitset<3> found;
  for (int axis = 0; axis < 3; ++axis) {
    const std::vector<double> middles =
        cell_middles(range.low.rotation_rad[axis], range.high.rotation_rad[axis], step_rad);
    if (middles.size() < 3) continue;
    const double half = 0.5 * (middles[1] - middles[0]);
    found[static_cast<std::size_t>(axis)] =
        rotation_rad[axis] < middles.front() + half || rotation_rad[axis] > middles.back() - half;
  }
  return found;
}

std::vector<Eigen::Matrix3d> all_rotations(double step_rad) {
  const std::vector<Eigen::Matrix3d> cube = cube_rotations();
  constexpr double kEighthTurn = std::numbers::pi / 4.0;
  const std::vector<double> middles = cell_middles(-kEighthTurn, kEighthTurn, step_rad);
  std::vector<Eigen::Matrix3d> near;
  for (const double x : middles)
    for (const double y : middles)
      for (const double z : middles) {
        const Eigen::Vector3d vector(x, y, z);
        const double angle = vector.norm();
        const Eigen::Matrix3d rotation =
            angle > 0.0 ? Eigen::AngleAxisd(angle, vector / angle).toRotationMatrix()
                        : Eigen::Matrix3d(Eigen::Matrix3d::Identity());
        if (is_nearest_to_identity(rotation, cube)) near.push_back(rotation);
      }
  std::vector<Eigen::Matrix3d> rotations;
  for (const Eigen::Matrix3d& of_cube : cube)
    for (const Eigen::Matrix3d& rotation : near) rotations.push_back(rotation * of_cube);
  return rotations;
}

std::vector<Eigen::Matrix3d> half_turns() {
  std::vector<Eigen::Matrix3d> turns{Eigen::Matrix3d::Identity()};
  for (int axis = 0; axis < 3; ++axis) {
    Eigen::Vector3d diagonal = Eigen::Vector3d::Constant(-1.0);
    diagonal[axis] = 1.0;
    turns.emplace_back(diagonal.asDiagonal());
  }
  return turns;
}

}  // namespace af::registration
