// SPDX-License-Identifier: Apache-2.0
// Mechanics of a cast ray: how its value changes when the volume moves.
#pragma once

#include <array>

#include <Eigen/Core>

#include "ct/ray_caster.h"
#include "ct/ray_caster_kernel.h"

namespace af {

/// A ray's path through the volume, in mm along i, j and k from voxel (0, 0, 0).
struct RayPath {
  static constexpr int kNoFace = -1;  ///< the source, or an end of the fan's layer

  Eigen::Vector3d begin;
  Eigen::Vector3d end;
  int begin_axis = kNoFace;  ///< normal of the face where it begins
  int end_axis = kNoFace;
  int samples = 0;  ///< 0: it misses
};

/// What one ray's samples add up to, in units of U: see SlopeSums.
struct RaySums {
  Eigen::Vector3d slopes;           ///< per mm along i, j, k
  Eigen::Vector3d numbered_slopes;  ///< likewise
  double stretched_begin;           ///< per mm along the ray
  double stretched_end;
};

/// dU by the motions of MotionSlopes. Moving the volume moves the ray and its samples the other
/// way, across the ray, so the samples act like forces on the two ends of the path. Motion along
/// the ray changes nothing within the volume. The ends slide along the faces that they lie on,
/// which matters where a face cuts a body.
class RayMechanics {
 public:
  RayMechanics(const CtGrid& grid, const MotionSlopes& motions);

  /// Per rad about the axes, then per mm along them. 0 for a ray that misses.
  [[nodiscard]] std::array<float, 6> slopes_of(const RayPath& path, const RaySums& sums) const;

 private:
  // In the frame of RayPath, which is left-handed when the grid's directions are.
  Eigen::Vector3d pivot_;
  Eigen::Matrix3d axes_;
  double handedness_;
};

}  // namespace af
