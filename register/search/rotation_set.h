// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <bitset>
#include <vector>

#include <Eigen/Core>

#include "geometry/motion_range.h"

namespace af::registration {

/// Rotations about the room's axes such that every rotation of the range is within half of
/// `step_rad` of one of them along each of the three angles: the middles of equal cells.
/// \test RotationSet.EveryRotationOfARangeHasOneNearby
std::vector<Eigen::Matrix3d> rotations_of_range(const MotionRange& range, double step_rad);

/// About which axes a rotation lies in the first or the last of three or more such cells: only an
/// inner one tells that nothing better lies beyond. \test RotationSet.KnowsTheOuterCellsOfARange
std::bitset<3> in_outer_cells(const MotionRange& range,
                              double step_rad,
                              const Eigen::Vector3d& rotation_rad);

/// Rotations such that every rotation is near one of them: about each of the 24 that map a cube
/// onto itself, rotation vectors on a cubic grid of at most `step_rad`, as far as no other of the
/// 24 is nearer. Neighbours along a rotation vector are at most a step apart, so that the farthest
/// rotation is about 0.9 steps from one of them.
/// \test RotationSet.EveryRotationHasOneNearby
std::vector<Eigen::Matrix3d> all_rotations(double step_rad);

/// None, and half a turn about each axis: what differs between patients who lie head first or feet
/// first, on the back or on the belly.
std::vector<Eigen::Matrix3d> half_turns();

}  // namespace af::registration
