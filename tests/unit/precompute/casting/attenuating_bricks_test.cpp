// SPDX-License-Identifier: Apache-2.0
#include "precompute/casting/attenuating_bricks.h"

#include <random>

#include <gtest/gtest.h>

#include "support/ct_phantoms.h"
#include "unit/precompute/casting/shear_warp_cases.h"

namespace af {
namespace {

constexpr std::array<int, 3> kSize = {21, 18, 25};

/// Two voxels far apart, so that the cropped volume is mostly air.
AttenuationVolume two_voxels() {
  CtVolume ct = box_phantom(test::centered_grid(kSize, {1.0, 1.0, 1.0}), {0, 0, 0}, {0, 0, 0}, 500);
  std::vector<std::int16_t> hu(ct.hu.view().begin(), ct.hu.view().end());
  hu.back() = 500;
  ct.hu = SharedArray<std::int16_t>(std::move(hu));
  return {ct, AttenuationModel{}};
}

/// Whether a voxel within `reach` of a point attenuates, looked for in all voxels.
bool has_voxel_near(const AttenuationVolume& volume,
                    const Eigen::Vector3d& index,
                    const std::array<int, 3>& reach) {
  const auto& size = volume.grid().size;
  const std::uint16_t* voxel = volume.voxels().data();
  for (int k = 0; k < size[2]; ++k)
    for (int j = 0; j < size[1]; ++j)
      for (int i = 0; i < size[0]; ++i, ++voxel)
        if (*voxel > 0 && std::abs(i - index.x()) <= reach[0] &&
            std::abs(j - index.y()) <= reach[1] && std::abs(k - index.z()) <= reach[2])
          return true;
  return false;
}

TEST(AttenuatingBricks, NeverMissesAVoxelWithinReach) {
  const AttenuationVolume volume = two_voxels();
  std::mt19937 random(1);
  std::uniform_real_distribution<double> place(-4.0, 30.0);
  for (const std::array<int, 3>& reach :
       {std::array{0, 0, 0}, std::array{1, 4, 2}, std::array{7, 3, 5}}) {
    const AttenuatingBricks bricks(volume, reach);
    int near = 0;
    for (int i = 0; i < 20000; ++i) {
      const Eigen::Vector3d index(place(random), place(random), place(random));
      if (!has_voxel_near(volume, index, reach)) continue;
      ASSERT_TRUE(bricks.is_near(index)) << index.transpose();
      ++near;
    }
    EXPECT_TRUE(near > 50 || reach[0] == 0) << near;
  }
}

TEST(AttenuatingBricks, LeavesOutWhatLiesBeyondReachAndTwoBricks) {
  const AttenuationVolume volume = two_voxels();
  const std::array<int, 3> reach = {2, 3, 1};
  // A brick where the voxel lies, and one that the reach is rounded up to: 2 voxels each.
  const std::array<int, 3> widened = {2 + 4, 3 + 4, 1 + 4};
  const AttenuatingBricks bricks(volume, reach);
  int far = 0;
  for (int k = 0; k < kSize[2]; ++k)
    for (int j = 0; j < kSize[1]; ++j)
      for (int i = 0; i < kSize[0]; ++i) {
        const Eigen::Vector3d index(i, j, k);
        if (has_voxel_near(volume, index, widened)) continue;
        ASSERT_FALSE(bricks.is_near(index)) << index.transpose();
        ++far;
      }
  EXPECT_GT(far, 5000);
}

}  // namespace
}  // namespace af
