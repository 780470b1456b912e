// SPDX-License-Identifier: Apache-2.0
#include "ct/attenuation_volume.h"

#include <algorithm>

#include <gtest/gtest.h>

#include "base/error.h"
#include "support/ct_phantoms.h"

namespace af {
namespace {

CtGrid grid_of(int i, int j, int k) {
  CtGrid grid;
  grid.size = {i, j, k};
  grid.spacing_mm = {0.5, 1.0, 2.0};
  grid.origin_mm = {-10.0, 20.0, 30.0};
  return grid;
}

TEST(AttenuationModel, FollowsTheContractsRule) {
  const AttenuationModel model;
  EXPECT_EQ(model.relative_attenuation(-1024), 0);
  EXPECT_EQ(model.relative_attenuation(-901), 0);
  EXPECT_EQ(model.relative_attenuation(-900), 100);
  EXPECT_EQ(model.relative_attenuation(0), 1000);
  EXPECT_EQ(model.relative_attenuation(32767), 33767);
  EXPECT_DOUBLE_EQ(model.mu_per_mm_per_unit() * 1000, 0.02);
}

TEST(AttenuationVolume, KeepsOnlyTheAttenuatingBoxWithAZeroBorder) {
  const CtVolume ct = box_phantom(grid_of(20, 10, 8), {4, 3, 2}, {9, 3, 5}, 500);
  const AttenuationVolume volume(ct, {});
  EXPECT_EQ(volume.grid().size, (std::array<int, 3>{8, 3, 6}));
  EXPECT_TRUE(volume.grid().origin_mm.isApprox(ct.grid.point_mm({3, 2, 1})));
  EXPECT_EQ(volume.grid_without_border().size, (std::array<int, 3>{6, 1, 4}));
  EXPECT_TRUE(volume.grid_without_border().origin_mm.isApprox(ct.grid.point_mm({4, 3, 2})));
  std::size_t attenuating = 0;
  for (const std::uint16_t voxel : volume.voxels()) {
    EXPECT_TRUE(voxel == 0 || voxel == 1500);
    attenuating += voxel > 0 ? 1 : 0;
  }
  EXPECT_EQ(attenuating, 6u * 1u * 4u);
  EXPECT_DOUBLE_EQ(volume.max_mu_per_mm(), 0.03);
}

TEST(AttenuationVolume, APartHoldsTheVoxelsOfItsBox) {
  const CtVolume ct = box_phantom(grid_of(20, 10, 8), {4, 3, 2}, {9, 6, 5}, 500);
  const AttenuationVolume volume(ct, {});
  // From between voxels 5 and 6 along i, beyond the volume along j, to voxel 4 itself along k.
  const CtBox box{ct.grid.point_mm({5.5, -3.0, 3.0}), ct.grid.point_mm({8.2, 40.0, 4.0})};
  const VolumePart part = part_within(volume, box);
  EXPECT_EQ(part.grid.size, (std::array<int, 3>{3 + 2, 4 + 2, 2 + 2}));
  EXPECT_TRUE(part.grid.point_mm({1, 1, 1}).isApprox(ct.grid.point_mm({6, 3, 3})));
  EXPECT_EQ(std::count(part.voxels.begin(), part.voxels.end(), 1500), 3 * 4 * 2);
  EXPECT_EQ(std::count(part.voxels.begin(), part.voxels.end(), 0),
            std::ssize(part.voxels) - 3 * 4 * 2);
  // A part of the CT reaches into the air around the volume.
  const VolumePart of_ct = part_within(ct, {}, box);
  EXPECT_EQ(of_ct.grid.size, (std::array<int, 3>{3 + 2, 10 + 2, 2 + 2}));
  EXPECT_EQ(std::count(of_ct.voxels.begin(), of_ct.voxels.end(), 1500), 3 * 4 * 2);
  EXPECT_TRUE(part_within(volume, {{500, 500, 500}, {510, 510, 510}}).voxels.empty());
}

TEST(AttenuationVolume, AllAirIsRefused) {
  const CtVolume ct = box_phantom(grid_of(4, 4, 4), {1, 1, 1}, {2, 2, 2}, -950);
  EXPECT_THROW(AttenuationVolume(ct, {}), InputError);
}

TEST(AttenuationModel, NamesBadConstants) {
  EXPECT_TRUE(problems(AttenuationModel{}).empty());
  EXPECT_EQ(problems(AttenuationModel{.mu_water_per_mm = 0.0, .air_below_hu = 5}).size(), 2u);
}

}  // namespace
}  // namespace af
