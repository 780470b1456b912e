// SPDX-License-Identifier: Apache-2.0
#include "drr/bone_volume.h"

#include <gtest/gtest.h>

#include "drr/tissue_model.h"
#include "support/ct_phantoms.h"
#include "support/cube_grid.h"

namespace af {
namespace {

TEST(BoneVolume, HoldsTheBonePartOfEveryVoxel) {
  const AttenuationVolume volume(
      ellipsoid_phantom(test::cube_grid(24, 4.0),
                        {{{0, 0, 0}, {40, 40, 40}, Eigen::Matrix3d::Identity(), 40},
                         {{8, 0, 0}, {20, 16, 24}, Eigen::Matrix3d::Identity(), 1200}}),
      {});
  const TissueModel tissue(volume.model());
  const auto bone = bone_volume(volume);
  ASSERT_EQ(bone->voxels().size(), volume.voxels().size());
  EXPECT_EQ(bone->grid().size, volume.grid().size);
  EXPECT_EQ(bone->grid().origin_mm, volume.grid().origin_mm);
  std::size_t with_bone = 0;
  for (std::size_t i = 0; i < volume.voxels().size(); ++i) {
    // Rounded to integers.
    EXPECT_NEAR(bone->voxels()[i], tissue.bone_part(volume.voxels()[i]), 0.5);
    EXPECT_LE(bone->voxels()[i], volume.voxels()[i]);
    with_bone += bone->voxels()[i] > 0 ? 1U : 0U;
  }
  EXPECT_GT(with_bone, 100U);
}

TEST(BoneVolume, OfSoftTissueIsEmpty) {
  const AttenuationVolume volume(box_phantom(test::cube_grid(8, 4.0), {2, 2, 2}, {5, 5, 5}, 60),
                                 {});
  EXPECT_EQ(bone_volume(volume)->max_mu_per_mm(), 0.0);
}

}  // namespace
}  // namespace af
