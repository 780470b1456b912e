// SPDX-License-Identifier: Apache-2.0
#include "evaluate/registration/registration_errors.h"

#include <cmath>

#include <gtest/gtest.h>

#include "base/error.h"
#include "unit/evaluate/camera_along_z.h"

namespace af::evaluation {
namespace {

using Eigen::Vector3d;

constexpr double kRoundingMm = 1e-10;  // a few dozen double operations on values below 1000 mm

RigidTransform moved_by(double x, double y, double z) {
  return RigidTransform(Eigen::Translation3d(x, y, z));
}

CameraRig one_camera() {
  return {Vector3d::Zero(), {test::camera_along_z()}};
}

/// The same camera beside the room: its beam goes along the room's x.
CameraGeometry camera_along_x() {
  CameraGeometry camera = test::camera_along_z();
  camera.name = "X";
  camera.source_point = {-600, 0, 0};
  camera.detector_origin_point = {400, -100, -100};
  camera.column_direction = Vector3d::UnitY();
  camera.row_direction = Vector3d::UnitZ();
  return camera;
}

RegistrationErrors errors_of_origin(const RigidTransform& pose, const CameraRig& rig) {
  const std::vector<Vector3d> points = {Vector3d::Zero()};
  return registration_errors(pose, RigidTransform::Identity(), points, Vector3d::Zero(), rig);
}

TEST(RegistrationErrors, OfAShiftAcrossTheBeamAreItsLengthAndItsMagnification) {
  const RegistrationErrors errors = errors_of_origin(moved_by(3, 4, 0), one_camera());
  EXPECT_NEAR(errors.translation_mm, 5.0, kRoundingMm);
  EXPECT_NEAR(errors.projection_isocenter_mm, 5.0, kRoundingMm);
  EXPECT_NEAR(errors.projection_detector_mm, 5.0 * 1000 / 600, kRoundingMm);
  // The line from the source through (3, 4, 0) passes the origin at 600 sin(atan(5 / 600)).
  EXPECT_NEAR(errors.mrpd_mm, 600 * 5 / std::hypot(600.0, 5.0), kRoundingMm);
  EXPECT_EQ(errors.rotation_deg, 0.0);
  EXPECT_NEAR(errors.depth_mm, 0.0, kRoundingMm);
}

TEST(RegistrationErrors, OfAShiftAlongTheBeamVanishInTheImage) {
  const RegistrationErrors errors = errors_of_origin(moved_by(0, 0, 7), one_camera());
  EXPECT_NEAR(errors.translation_mm, 7.0, kRoundingMm);
  EXPECT_NEAR(errors.projection_detector_mm, 0.0, kRoundingMm);
  EXPECT_NEAR(errors.projection_isocenter_mm, 0.0, kRoundingMm);
  EXPECT_NEAR(errors.mrpd_mm, 0.0, kRoundingMm);
  EXPECT_NEAR(errors.depth_mm, 7.0, kRoundingMm);
  EXPECT_NEAR(errors_of_origin(moved_by(0, 0, -7), one_camera()).depth_mm, 7.0, kRoundingMm);
}

// The beam that counts is that to the target's centre: here (450, 0, 0), 750 mm from the source.
TEST(RegistrationErrors, OfDepthAreAlongTheBeamToTheTarget) {
  const std::vector<Vector3d> points = {{450, 10, 0}, {450, -10, 0}};
  const RegistrationErrors errors = registration_errors(
      moved_by(5, 0, 10), RigidTransform::Identity(), points, Vector3d::Zero(), one_camera());
  EXPECT_NEAR(errors.depth_mm, 5 * 0.6 + 10 * 0.8, kRoundingMm);
}

TEST(RegistrationErrors, AreMeansOverCamerasAndPoints) {
  CameraRig rig = one_camera();
  rig.cameras.push_back(camera_along_x());
  // Across the first camera's beam, along the second's.
  EXPECT_NEAR(errors_of_origin(moved_by(6, 0, 0), rig).projection_isocenter_mm, 3.0, kRoundingMm);
  EXPECT_TRUE(std::isnan(errors_of_origin(moved_by(6, 0, 0), rig).depth_mm));
  // Points of depths 600 and 1200 mm, moved 6 mm: 10 mm and 5 mm on the detector.
  const std::vector<Vector3d> points = {{0, 0, 0}, {0, 0, 600}};
  const RegistrationErrors errors = registration_errors(
      moved_by(6, 0, 0), RigidTransform::Identity(), points, Vector3d::Zero(), one_camera());
  EXPECT_NEAR(errors.projection_detector_mm, 7.5, kRoundingMm);
  EXPECT_NEAR(errors.projection_isocenter_mm, 4.5, kRoundingMm);
}

TEST(RegistrationErrors, OfATurnAboutTheCenterAreItsAngleAndNoTranslation) {
  const Vector3d center(10, -20, 30);
  const PoseFrame frame = PoseFrame::about(RigidTransform::Identity(), center);
  const RigidTransform turned =
      pose_from_parameters(frame, PoseParameters::from_deg_and_mm({0, 0, 2, 0, 0, 0}));
  const std::vector<Vector3d> points = {center + Vector3d(100, 0, 0)};
  const RegistrationErrors errors =
      registration_errors(turned, RigidTransform::Identity(), points, center, one_camera());
  EXPECT_NEAR(errors.rotation_deg, 2.0, kRoundingMm);
  EXPECT_NEAR(errors.translation_mm, 0.0, kRoundingMm);
  // A chord of 2 * 100 sin(1 deg), seen at depth 630 mm.
  const double chord_mm = 200 * std::sin(1.0 * kRadPerDeg);
  EXPECT_NEAR(errors.projection_detector_mm, chord_mm * 1000 / 630, kRoundingMm);
}

TEST(RegistrationErrors, OfEqualPosesAreZero) {
  const RigidTransform pose = moved_by(12, -7, 5);
  const std::vector<Vector3d> points = {{1, 2, 3}, {-4, 5, 60}};
  const RegistrationErrors errors =
      registration_errors(pose, pose, points, Vector3d(1, 1, 1), one_camera());
  // The direction of the ray is rounded: 1e-16 times 600 mm.
  for (const double value : errors.values()) EXPECT_NEAR(value, 0.0, kRoundingMm);
}

TEST(RegistrationErrors, BehindTheSourceHaveNoProjection) {
  const RegistrationErrors errors = errors_of_origin(moved_by(0, 0, -700), one_camera());
  EXPECT_TRUE(std::isnan(errors.mrpd_mm));
  EXPECT_TRUE(std::isnan(errors.projection_detector_mm));
  EXPECT_NEAR(errors.translation_mm, 700.0, kRoundingMm);
}

TEST(RegistrationErrors, NeedPointsAndCameras) {
  EXPECT_THROW(errors_of_origin(moved_by(0, 0, 0), CameraRig{}), InputError);
  EXPECT_THROW(registration_errors(RigidTransform::Identity(),
                                   RigidTransform::Identity(),
                                   {},
                                   Vector3d::Zero(),
                                   one_camera()),
               InputError);
}

}  // namespace
}  // namespace af::evaluation
