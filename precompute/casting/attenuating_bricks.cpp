// SPDX-License-Identifier: Apache-2.0
#include "precompute/casting/attenuating_bricks.h"

#include <algorithm>

namespace af {

AttenuatingBricks::AttenuatingBricks(const AttenuationVolume& volume,
                                     const std::array<int, 3>& reach_voxels) {
  for (std::size_t axis = 0; axis < 3; ++axis)
    counts_[axis] = (volume.grid().size[axis] + kBrickVoxels - 1) / kBrickVoxels;
  is_near_.resize(static_cast<std::size_t>(counts_[0]) * static_cast<std::size_t>(counts_[1]) *
                  static_cast<std::size_t>(counts_[2]));
  mark(volume);
  for (std::size_t axis = 0; axis < 3; ++axis)
    widen(axis, (reach_voxels[axis] + kBrickVoxels - 1) / kBrickVoxels);
}

void AttenuatingBricks::mark(const AttenuationVolume& volume) {
  const auto& size = volume.grid().size;
  const std::uint16_t* row = volume.voxels().data();
  for (int k = 0; k < size[2]; ++k)
    for (int j = 0; j < size[1]; ++j, row += size[0]) {
      std::uint8_t* bricks =
          is_near_.data() +
          (static_cast<std::ptrdiff_t>(k / kBrickVoxels) * counts_[1] + j / kBrickVoxels) *
              counts_[0];
      for (int begin = 0; begin < size[0]; begin += kBrickVoxels, ++bricks) {
        unsigned any = 0;
        for (int i = begin; i < std::min(begin + kBrickVoxels, size[0]); ++i) any |= row[i];
        if (any != 0) *bricks = 1;
      }
    }
}

void AttenuatingBricks::widen(std::size_t axis, int bricks) {
  std::size_t stride = 1;
  for (std::size_t before = 0; before < axis; ++before)
    stride *= static_cast<std::size_t>(counts_[before]);
  const std::vector<std::uint8_t> narrow = is_near_;
  for (std::size_t brick = 0; brick < narrow.size(); ++brick) {
    if (narrow[brick] == 0) continue;
    const int at = static_cast<int>(brick / stride % static_cast<std::size_t>(counts_[axis]));
    const int first = std::max(0, at - bricks);
    const int last = std::min(counts_[axis] - 1, at + bricks);
    std::size_t to = brick - static_cast<std::size_t>(at - first) * stride;
    for (int i = first; i <= last; ++i, to += stride) is_near_[to] = 1;
  }
}

}  // namespace af
