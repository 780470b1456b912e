// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "ct/ct_volume.h"

namespace af {

/// An ellipsoid of constant HU; later bodies replace earlier ones where they overlap.
struct Ellipsoid {
  Eigen::Vector3d center_mm = Eigen::Vector3d::Zero();
  Eigen::Vector3d semi_axes_mm = Eigen::Vector3d::Ones();
  Eigen::Matrix3d rotation =
      Eigen::Matrix3d::Identity();  ///< columns: the body's axes in the ct frame
  int hu = 0;

  /// Length (mm) of the chord that the line through two points cuts out of the body; 0 when it
  /// misses.
  [[nodiscard]] double chord_length_mm(const Eigen::Vector3d& point,
                                       const Eigen::Vector3d& through_point) const;
};

/// An axis-aligned box of constant HU in air (-1000 HU) with faces on voxel borders. Chords through
/// it are known exactly, so it tests the casters.
CtVolume box_phantom(const CtGrid& grid,
                     const std::array<int, 3>& first_voxel,
                     const std::array<int, 3>& last_voxel,
                     int hu);

/// Bodies sampled on `grid` in air (-1000 HU). Each voxel is the mean of `samples_per_axis`^3
/// points.
CtVolume ellipsoid_phantom(const CtGrid& grid,
                           const std::vector<Ellipsoid>& bodies,
                           int samples_per_axis = 3);

}  // namespace af
