// SPDX-License-Identifier: Apache-2.0
// The largest values of smooth functions over all rotations of a motion range.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include "geometry/motion_range.h"

namespace af {

/// The largest value found of a function of the rotation, and where.
struct RotationMaximum {
  Eigen::Vector3d angles;
  double value;

  /// Takes `candidate` at `at` if it is larger, and says whether it did.
  bool takes(const Eigen::Vector3d& at, double candidate) {
    if (!(candidate > value)) return false;
    value = candidate;
    angles = at;
    return true;
  }
};

/// The grid of rotations where a search begins. It holds the box's corners, edges and centre.
struct RotationGrid {
  Eigen::Vector3d low;
  Eigen::Vector3d high;
  std::array<int, 3> intervals{};
  Eigen::Vector3d step;

  explicit RotationGrid(const MotionRange& range)
      : low(range.low.rotation_rad), high(range.high.rotation_rad) {
    constexpr double kWidestStepRad = 15.0 * kRadPerDeg;
    for (int axis = 0; axis < 3; ++axis) {
      const double width = high[axis] - low[axis];
      const int count = std::max(8, static_cast<int>(std::ceil(width / kWidestStepRad)));
      // An axis without room needs only its first node.
      intervals[static_cast<std::size_t>(axis)] = width > 0.0 ? count : 0;
      step[axis] = width / count;
    }
  }

  [[nodiscard]] Eigen::Vector3d middle() const {
    return Eigen::Vector3d::Zero().cwiseMax(low).cwiseMin(high);
  }
  template <typename Visit>
  void for_each(const Visit& visit) const {
    for (int i = 0; i <= intervals[0]; ++i)
      for (int j = 0; j <= intervals[1]; ++j)
        for (int k = 0; k <= intervals[2]; ++k)
          visit(Eigen::Vector3d(low + step.cwiseProduct(Eigen::Vector3d(i, j, k))));
  }
};

/// Pattern search from the best node of the grid.
template <typename Objective>
double refined(RotationMaximum best, const RotationGrid& grid, const Objective& objective) {
  constexpr double kFinalStepRad = 1e-8;
  for (Eigen::Vector3d step = grid.step / 2.0; step.maxCoeff() > kFinalStepRad;) {
    const Eigen::Vector3d center = best.angles;
    bool improved = false;
    for (int axis = 0; axis < 3; ++axis)
      for (const double sign : {-1.0, 1.0}) {
        Eigen::Vector3d angles = center;
        angles[axis] =
            std::clamp(angles[axis] + sign * step[axis], grid.low[axis], grid.high[axis]);
        improved = best.takes(angles, objective(angles)) || improved;
      }
    if (!improved) step /= 2.0;
  }
  return best.value;
}

/// Maximises smooth functions over the rotation box, each from its best node of one grid. At large
/// angles extremes lie inside the box, so corners alone are not enough. `turned(angles)` computes
/// what the functions share at a rotation; `value(shared, i)` is function i of `count`.
template <typename Turned, typename Value>
std::vector<double> maxima_over_rotations(const MotionRange& range,
                                          std::size_t count,
                                          const Turned& turned,
                                          const Value& value) {
  const RotationGrid grid(range);
  std::vector<RotationMaximum> best;
  const auto at_middle = turned(grid.middle());
  for (std::size_t i = 0; i < count; ++i) best.push_back({grid.middle(), value(at_middle, i)});
  grid.for_each([&](const Eigen::Vector3d& angles) {
    const auto at_node = turned(angles);
    for (std::size_t i = 0; i < count; ++i) best[i].takes(angles, value(at_node, i));
  });
  std::vector<double> maxima;
  for (std::size_t i = 0; i < count; ++i)
    maxima.push_back(refined(
        best[i], grid, [&](const Eigen::Vector3d& angles) { return value(turned(angles), i); }));
  return maxima;
}

}  // namespace af
