// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

#include "ct/attenuation_volume.h"

namespace af {

/// Marks where a volume attenuates, in bricks of 2 x 2 x 2 voxels widened by a reach, and tells
/// whether all voxels around a point are 0. Takes one byte per brick.
/// \test AttenuatingBricks.NeverMissesAVoxelWithinReach
class AttenuatingBricks {
 public:
  /// `reach_voxels`: along i, j, k, at least 0.
  AttenuatingBricks(const AttenuationVolume& volume, const std::array<int, 3>& reach_voxels);

  /// False only when every voxel within the reach of `index` (continuous voxel indices) is 0.
  /// Indices outside the volume are moved onto its border.
  [[nodiscard]] bool is_near(const Eigen::Vector3d& index) const {
    std::size_t brick = 0;
    for (int axis = 2; axis >= 0; --axis) {
      const int count = counts_[static_cast<std::size_t>(axis)];
      const int of_axis = static_cast<int>(index[axis] * (1.0 / kBrickVoxels));
      brick = brick * static_cast<std::size_t>(count) +
              static_cast<std::size_t>(std::clamp(of_axis, 0, count - 1));
    }
    return is_near_[brick] != 0;
  }

 private:
  static constexpr int kBrickVoxels = 2;

  void mark(const AttenuationVolume& volume);
  void widen(std::size_t axis, int bricks);

  std::array<int, 3> counts_{};
  std::vector<std::uint8_t> is_near_;
};

}  // namespace af
