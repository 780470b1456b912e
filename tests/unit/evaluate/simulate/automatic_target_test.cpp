// SPDX-License-Identifier: Apache-2.0
#include "evaluate/simulate/automatic_target.h"

#include <cmath>

#include <gtest/gtest.h>

#include "base/error.h"
#include "evaluate/simulate/spine_phantom.h"
#include "support/ct_phantoms.h"

namespace af {
namespace {

using Eigen::Vector3d;

CtGrid block_grid(const Eigen::Matrix3d& direction) {
  CtGrid grid;
  grid.size = {80, 90, 70};
  grid.spacing_mm = {2.5, 2.0, 3.0};
  grid.direction = direction;
  grid.origin_mm = Vector3d(10.0, 20.0, 30.0) -
                   direction * Vector3d(79, 89, 69).cwiseProduct(grid.spacing_mm) / 2.0;
  return grid;
}

CtVolume body_with_bone(const Eigen::Matrix3d& direction, const Vector3d& bone_center_mm) {
  Ellipsoid body;
  body.center_mm = {10.0, 20.0, 30.0};
  body.semi_axes_mm = {80.0, 80.0, 90.0};
  body.hu = 40;
  Ellipsoid bone;
  bone.center_mm = bone_center_mm;
  bone.semi_axes_mm = {15.0, 15.0, 20.0};
  bone.hu = 800;
  return ellipsoid_phantom(block_grid(direction), {body, bone}, 1);
}

TEST(AutomaticTarget, CentresOnABoneWhateverTheVoxelAxes) {
  const Vector3d bone(25.0, 50.0, 35.0);
  Eigen::Matrix3d flipped;
  flipped << 0, -1, 0, -1, 0, 0, 0, 0, -1;
  for (const Eigen::Matrix3d& direction : {Eigen::Matrix3d(Eigen::Matrix3d::Identity()), flipped}) {
    const RegistrationTarget target = find_target(body_with_bone(direction, bone));
    // The bone is symmetric about its centre: its voxels' centroid errs by less than half a voxel.
    EXPECT_LT((target.center_ct_mm - bone).norm(), 1.5);
    EXPECT_LT((target.box_ct.high_mm - target.box_ct.low_mm - Vector3d::Constant(60.0)).norm(),
              1e-9);
  }
}

TEST(AutomaticTarget, FallsBackToTheCentroidWithoutBone) {
  const CtVolume ct =
      ellipsoid_phantom(block_grid(Eigen::Matrix3d::Identity()),
                        {{{10.0, 20.0, 30.0}, {70.0, 70.0, 80.0}, Eigen::Matrix3d::Identity(), 40}},
                        1);
  EXPECT_LT((find_target(ct).center_ct_mm - Vector3d(10.0, 20.0, 30.0)).norm(), 1.0);
}

TEST(AutomaticTarget, FindsTheMiddleVertebraOfTheSpinePhantom) {
  const RegistrationTarget target = find_target(sample_phantom(spine_phantom(false), {2.0, 1, 0}));
  // Within half a vertebral pitch along the spine, and within the vertebra across it.
  EXPECT_LT(std::abs(target.center_ct_mm.z()), 16.5);
  EXPECT_LT(std::abs(target.center_ct_mm.x()), 8.0);
  EXPECT_GT(target.center_ct_mm.y(), -5.0);
  EXPECT_LT(target.center_ct_mm.y(), 25.0);
}

TEST(AutomaticTarget, RefusesAVolumeOfAir) {
  const CtVolume ct = ellipsoid_phantom(block_grid(Eigen::Matrix3d::Identity()), {}, 1);
  EXPECT_THROW(find_target(ct), InputError);
}

CameraGeometry camera(int size_px) {
  CameraGeometry camera;
  camera.name = "A";
  camera.source_point = {0.0, -1000.0, 0.0};
  const double half = 0.2 * (size_px - 1);
  camera.detector_origin_point = {-half, 500.0, half};
  camera.column_direction = {1.0, 0.0, 0.0};
  camera.row_direction = {0.0, 0.0, -1.0};
  camera.pixel_spacing_mm = {0.4, 0.4};
  camera.size_px = {size_px, size_px};
  return camera;
}

TEST(TargetRegion, IsCentredOnTheProjectedBox) {
  const RegistrationTarget target = target_box_at({0.0, 0.0, 0.0}, 20.0);
  const RegionOfInterest roi =
      target_region(camera(512), RigidTransform::Identity(), target, {200, 180});
  // The detector's centre is at 255.5: columns 156 to 355, rows 166 to 345.
  EXPECT_EQ(roi.column, 156);
  EXPECT_EQ(roi.width, 200);
  EXPECT_EQ(roi.row, 166);
  EXPECT_EQ(roi.height, 180);
}

TEST(TargetRegion, GrowsToHoldTheProjectedBox) {
  const RegistrationTarget target = target_box_at({0.0, 0.0, 0.0}, 60.0);
  const RegionOfInterest roi =
      target_region(camera(512), RigidTransform::Identity(), target, {100, 100});
  // The near face, at 970 mm of 1500, is 60 * 1500 / 970 / 0.4 = 231.96 px wide.
  EXPECT_EQ(roi.width, 248);
  EXPECT_EQ(roi.height, 248);
}

TEST(TargetRegion, StaysTwoPixelsInsideTheDetector) {
  const RegistrationTarget target = target_box_at({60.0, 0.0, 60.0}, 20.0);
  const RegionOfInterest roi =
      target_region(camera(512), RigidTransform::Identity(), target, {200, 200});
  EXPECT_EQ(roi.column + roi.width, 510);
  EXPECT_EQ(roi.row, 2);
  EXPECT_LT(roi.width, 200);
}

TEST(TargetRegion, RefusesATargetOffTheDetectorOrBehindTheSource) {
  const RigidTransform pose = RigidTransform::Identity();
  EXPECT_THROW(target_region(camera(512), pose, target_box_at({400, 0, 0}, 20.0), {200, 200}),
               InputError);
  EXPECT_THROW(target_region(camera(512), pose, target_box_at({0, -1000, 0}, 20.0), {200, 200}),
               InputError);
}

TEST(TargetRegion, DefaultSizeFitsSmallDetectors) {
  EXPECT_EQ(default_region_size_px(camera(512)), Eigen::Vector2i(200, 200));
  EXPECT_EQ(default_region_size_px(camera(256)), Eigen::Vector2i(153, 153));
}

}  // namespace
}  // namespace af
