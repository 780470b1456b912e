// SPDX-License-Identifier: Apache-2.0
#include "evaluate/simulate/spine_phantom.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "evaluate/simulate/automatic_target.h"

namespace af {
namespace {

using Eigen::Vector3d;

/// One coarse phantom for all tests here.
const CtVolume& phantom() {
  static const CtVolume ct = sample_phantom(spine_phantom(false), {2.0, 2, 0});
  return ct;
}

/// HU of the voxel at a point; air outside the volume.
int hu_at(const Vector3d& ct_point_mm) {
  const CtGrid& grid = phantom().grid;
  const Vector3d index = grid.index_of(ct_point_mm).array().round();
  for (int axis = 0; axis < 3; ++axis)
    if (index[axis] < 0 || index[axis] >= grid.size[static_cast<std::size_t>(axis)]) return -1000;
  const auto i = static_cast<std::size_t>(index.x());
  const auto j = static_cast<std::size_t>(index.y());
  const auto k = static_cast<std::size_t>(index.z());
  return phantom().hu[(k * static_cast<std::size_t>(grid.size[1]) + j) *
                          static_cast<std::size_t>(grid.size[0]) +
                      i];
}

/// Largest HU in a box.
int largest_hu(const Vector3d& low, const Vector3d& high) {
  int largest = -1000;
  for (double z = low.z(); z <= high.z(); z += 2.0)
    for (double y = low.y(); y <= high.y(); y += 2.0)
      for (double x = low.x(); x <= high.x(); x += 2.0)
        largest = std::max(largest, hu_at({x, y, z}));
  return largest;
}

/// Voxels below -950 HU inside the trunk, left (+1) or right (-1) of the spine.
int gas_voxels(double side) {
  int count = 0;
  for (double z = -120.0; z <= 60.0; z += 2.0)
    for (double y = -90.0; y <= 30.0; y += 2.0)
      for (double x = 20.0; x <= 80.0; x += 2.0) count += hu_at({side * x, y, z}) < -950 ? 1 : 0;
  return count;
}

TEST(SpinePhantom, IsCentredOnTheOriginWithUprightLpsAxes) {
  const CtGrid& grid = phantom().grid;
  EXPECT_NEAR(grid.center_mm().norm(), 0.0, 1e-12);
  EXPECT_TRUE(grid.direction.isIdentity());
}

TEST(SpinePhantom, HasNineVertebraeWithCorticalShellsAndSofterCores) {
  const std::vector<Vector3d> centers = spine_phantom_vertebra_centers();
  ASSERT_EQ(centers.size(), 9u);
  for (const Vector3d& center : centers) {
    const int core = hu_at(center);
    EXPECT_GT(core, 100) << center.transpose();
    EXPECT_LT(core, 400) << center.transpose();
    // The front of the shell, where the cylinder's waist is: within 4 mm of the half depth.
    EXPECT_GT(largest_hu(center - Vector3d(2, 19, 2), center - Vector3d(-2, 9, -2)), 500)
        << center.transpose();
  }
}

TEST(SpinePhantom, HasSoftDiscsBetweenTheVertebrae) {
  const std::vector<Vector3d> centers = spine_phantom_vertebra_centers();
  for (std::size_t i = 1; i < centers.size(); ++i) {
    const int disc = hu_at(0.5 * (centers[i - 1] + centers[i]));
    EXPECT_GE(disc, 60);
    EXPECT_LE(disc, 120);
  }
}

TEST(SpinePhantom, SpinousProcessesPointBackAndTheCanalIsSoft) {
  for (const Vector3d& center : spine_phantom_vertebra_centers()) {
    if (center.z() < -120.0) continue;  // cut by the volume's end
    // Behind the arch, on the midline: bone; in front of the body: none.
    EXPECT_GT(largest_hu(center + Vector3d(-6, 32, -24), center + Vector3d(6, 50, 4)), 500);
    EXPECT_LT(largest_hu(center + Vector3d(-6, -50, -10), center + Vector3d(6, -24, 10)), kBoneHu);
    const double canal_y = center.y() + 23.0;
    EXPECT_LT(hu_at({center.x(), canal_y, center.z()}), 200);
  }
}

TEST(SpinePhantom, HeadEndHasRibsAndLungsAndFootEndHasNeither) {
  // Ribs on both sides at the upper end, outside the spine.
  for (const double side : {-1.0, 1.0}) {
    EXPECT_GT(largest_hu({side > 0 ? 60.0 : -130.0, -90, 60}, {side > 0 ? 130.0 : -60.0, 70, 130}),
              500);
    EXPECT_LT(
        largest_hu({side > 0 ? 60.0 : -130.0, -90, -130}, {side > 0 ? 130.0 : -60.0, 70, -70}),
        kBoneHu);
  }
  EXPECT_LT(hu_at({-60, 0, 125}), -600);
  EXPECT_GT(hu_at({-60, 0, -125}), -200);
}

TEST(SpinePhantom, GasLiesOnThePatientsLeftAndTheLiverOnTheRight) {
  EXPECT_GT(gas_voxels(1.0), 1000);
  EXPECT_EQ(gas_voxels(-1.0), 0);
  EXPECT_GT(hu_at({-70, -40, 0}), 40);  // liver
}

TEST(SpinePhantom, SkinIsFatWithAirAround) {
  EXPECT_LT(hu_at({0, 74, -66}), -50);
  EXPECT_EQ(hu_at({170, 0, 0}), -1000);
  EXPECT_EQ(hu_at({0, 120, 0}), -1000);
}

TEST(SpinePhantom, TargetHoldsTheMiddleVertebraOnly) {
  const RegistrationTarget target = spine_phantom_target();
  EXPECT_TRUE((target.box_ct.low_mm.array() < -10.0).all());
  EXPECT_TRUE((target.box_ct.high_mm.array() > 10.0).all());
  EXPECT_LE(target.box_ct.high_mm.z() - target.box_ct.low_mm.z(), 40.0);
}

TEST(SpinePhantom, VoxelsAreReproducible) {
  const CtVolume again = sample_phantom(spine_phantom(false), {2.0, 2, 1});
  EXPECT_TRUE(
      std::equal(again.hu.view().begin(), again.hu.view().end(), phantom().hu.view().begin()));
}

TEST(PhantomOptions, ReportsEveryBrokenConstraint) {
  EXPECT_TRUE(problems(PhantomOptions{}).empty());
  EXPECT_THAT(problems(PhantomOptions{0.1, 9, 0}),
              ::testing::ElementsAre(::testing::HasSubstr("voxel_mm = 0.1"),
                                     ::testing::HasSubstr("samples_per_axis = 9")));
}

}  // namespace
}  // namespace af
