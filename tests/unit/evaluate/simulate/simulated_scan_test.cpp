// SPDX-License-Identifier: Apache-2.0
#include "evaluate/simulate/simulated_scan.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"

namespace af::tools {
namespace {

using testing::HasSubstr;

/// 1000 mm from source to isocentre (1, 2, 3), 1500 to a detector whose middle is 5 columns and 2
/// rows off the beam's foot.
CameraGeometry scanner() {
  CameraGeometry camera;
  camera.name = "C";
  camera.size_px = {101, 81};
  camera.pixel_spacing_mm = {2.0, 3.0};
  camera.column_direction = Eigen::Vector3d::UnitX();
  camera.row_direction = -Eigen::Vector3d::UnitZ();
  camera.source_point = Eigen::Vector3d(1.0, -998.0, 3.0);
  camera.detector_origin_point = Eigen::Vector3d(1.0 - 55.0 * 2.0, 502.0, 3.0 + 42.0 * 3.0);
  return camera;
}

ConeBeamOptions views(int count) {
  ConeBeamOptions options;
  options.views = count;
  return options;
}

/// Coordinates reach some 1500 mm, and each operation rounds them by up to 1e-13 mm.
constexpr double kRoundingMm = 1e-9;

TEST(SimulatedScan, HasTheCamerasDistancesAndFoot) {
  const CircularScan scan = orbit_of(scanner(), Eigen::Vector3d(1.0, 2.0, 3.0), views(90));
  EXPECT_NEAR(scan.source_to_axis_mm, 1000.0, kRoundingMm);
  EXPECT_NEAR(scan.source_to_detector_mm, 1500.0, kRoundingMm);
  EXPECT_LT((scan.stated_foot_px() - Eigen::Vector2d(55.0, 42.0)).norm(), kRoundingMm);
  ASSERT_EQ(scan.angles_rad.size(), 90U);
  EXPECT_NEAR(scan.angles_rad[1] * kDegPerRad, 4.0, 1e-12);
  EXPECT_TRUE(problems(scan).empty());
}

TEST(SimulatedScan, RefusesACameraThatLooksPastTheIsocentre) {
  try {
    (void)orbit_of(scanner(), Eigen::Vector3d(3.0, 2.0, 3.0), views(90));
    FAIL() << "2 mm beside the isocentre are 1.5 pixels";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("must look straight at the rig's isocentre"));
  }
}

TEST(SimulatedScan, LiftsCamerasOnASphereThatLookAtTheOrigin) {
  const CircularScan scan = orbit_of(scanner(), Eigen::Vector3d(1.0, 2.0, 3.0), views(90));
  const double angle_rad = 0.7;
  const CameraGeometry flat = elevated_camera(scan, angle_rad, 0.0, "flat");
  const CameraGeometry lifted = elevated_camera(scan, angle_rad, 30.0, "lifted");
  EXPECT_NEAR(flat.source_point.z(), 0.0, kRoundingMm);
  EXPECT_NEAR(lifted.source_point.z(), 500.0, kRoundingMm) << "1000 sin 30";
  for (const CameraGeometry& camera : {flat, lifted}) {
    EXPECT_NEAR(camera.source_point.norm(), 1000.0, kRoundingMm);
    EXPECT_LT((camera.project(Eigen::Vector3d::Zero()) - Eigen::Vector2d(55.0, 42.0)).norm(), 1e-9);
    // The lifted source still stands over the same place on the circle.
    EXPECT_NEAR(camera.source_point.x() * flat.source_point.y(),
                camera.source_point.y() * flat.source_point.x(),
                1e-6);
    EXPECT_FALSE(camera.is_mirrored());
  }
}

}  // namespace
}  // namespace af::tools
