// SPDX-License-Identifier: Apache-2.0
#include "geometry/pose_in_range.h"

#include <cstddef>

namespace af {

PoseParameters pose_at(const MotionRange& range, const std::array<double, 6>& share) {
  const auto between = [](double low, double high, double x) { return low + (high - low) * x; };
  PoseParameters parameters;
  for (int i = 0; i < 3; ++i) {
    const auto p = static_cast<std::size_t>(i);
    parameters.rotation_rad[i] =
        between(range.low.rotation_rad[i], range.high.rotation_rad[i], share[p]);
    parameters.translation_mm[i] =
        between(range.low.translation_mm[i], range.high.translation_mm[i], share[p + 3]);
  }
  return parameters;
}

PoseParameters corner_pose(const MotionRange& range, unsigned corner) {
  const auto bound = [&](unsigned parameter) -> const PoseParameters& {
    return (corner >> parameter & 1u) != 0 ? range.high : range.low;
  };
  PoseParameters parameters;
  for (unsigned axis = 0; axis < 3; ++axis) {
    parameters.rotation_rad[axis] = bound(axis).rotation_rad[axis];
    parameters.translation_mm[axis] = bound(axis + 3).translation_mm[axis];
  }
  return parameters;
}

PoseParameters random_pose(const MotionRange& range, HashRandom& random) {
  std::array<double, 6> share{};
  for (double& of_axis : share) of_axis = random.uniform();
  return pose_at(range, share);
}

}  // namespace af
