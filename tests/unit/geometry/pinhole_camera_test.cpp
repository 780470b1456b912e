// SPDX-License-Identifier: Apache-2.0
#include "geometry/pinhole_camera.h"

#include <cmath>

#include <Eigen/Geometry>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "base/hash_random.h"
#include "geometry/rigid_transform.h"
#include "support/io_checks.h"

namespace af {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using testing::HasSubstr;

// Coordinates to 1e3 px and mm, a handful of roundings of 1e-16 each, magnified by the focal length
// in pixels over the depth in mm, at most 10.
constexpr double kPinholePx = 1e-9;
constexpr double kPinholeMm = 1e-9;

PinholeCamera some_pinhole() {
  PinholeCamera pinhole;
  pinhole.pixels_from_camera << 1200.0, 0.0, 255.5, 0.0, 1100.0, 200.25, 0.0, 0.0, 1.0;
  pinhole.camera_from_room = rotation_from_angles({0.3, -0.2, 0.5});
  pinhole.translation_mm = {10.0, -20.0, 900.0};
  return pinhole;
}

Vector2d seen_at(const PinholeCamera& pinhole, const Vector3d& point) {
  const Vector3d pixels =
      pinhole.pixels_from_camera * (pinhole.camera_from_room * point + pinhole.translation_mm);
  return pixels.hnormalized();
}

TEST(PinholeCamera, IsTheCameraThatProjectsAsItsMatrix) {
  const PinholeCamera pinhole = some_pinhole();
  const CameraGeometry camera = camera_from_pinhole("A", pinhole, 0.5, {512, 400});
  EXPECT_TRUE(problems(camera).empty());
  EXPECT_FALSE(camera.is_mirrored());
  EXPECT_NEAR(camera.source_detector_distance_mm(), 600.0, kPinholeMm);
  for (const Vector3d& point : {Vector3d(0, 0, 0), Vector3d(30, -40, 55), Vector3d(-25, 60, -70)})
    EXPECT_LT((camera.project(point) - seen_at(pinhole, point)).norm(), kPinholePx);
}

TEST(PinholeCamera, NegativeFocalLengthsMirror) {
  PinholeCamera pinhole = some_pinhole();
  pinhole.pixels_from_camera(0, 0) *= -1.0;
  const CameraGeometry camera = camera_from_pinhole("A", pinhole, 0.5, {512, 400});
  EXPECT_TRUE(camera.is_mirrored());
  const Vector3d point(30.0, -40.0, 55.0);
  EXPECT_LT((camera.project(point) - seen_at(pinhole, point)).norm(), kPinholePx);
}

TEST(PinholeCamera, OfACameraGivesTheCameraBack) {
  HashRandom random(3);
  for (int i = 0; i < 100; ++i) {
    const Eigen::Matrix3d axes = rotation_from_angles(
        {random.uniform(-3.0, 3.0), random.uniform(-3.0, 3.0), random.uniform(-3.0, 3.0)});
    CameraGeometry camera;
    camera.name = "A";
    camera.column_direction = (i % 2 == 0 ? 1.0 : -1.0) * axes.col(0);
    camera.row_direction = axes.col(1);
    camera.source_point = {random.uniform(-500.0, 500.0), 20.0, random.uniform(-500.0, 500.0)};
    camera.detector_origin_point = camera.source_point +
                                   random.uniform(500.0, 1500.0) * axes.col(2) +
                                   random.uniform(-99.0, 99.0) * axes.col(0);
    camera.pixel_spacing_mm = {random.uniform(0.1, 1.0), random.uniform(0.1, 1.0)};
    camera.size_px = {300, 200};
    const PinholeCamera pinhole = pinhole_of(camera);
    EXPECT_NEAR(pinhole.camera_from_room.determinant(), 1.0, 1e-12);
    const CameraGeometry back =
        camera_from_pinhole("A", pinhole, camera.pixel_spacing_mm.x(), camera.size_px);
    EXPECT_LT((back.source_point - camera.source_point).norm(), kPinholeMm);
    EXPECT_LT((back.detector_origin_point - camera.detector_origin_point).norm(), kPinholeMm);
    EXPECT_LT((back.column_direction - camera.column_direction).norm(), 1e-12);
    EXPECT_LT((back.row_direction - camera.row_direction).norm(), 1e-12);
    EXPECT_NEAR(back.pixel_spacing_mm.y(), camera.pixel_spacing_mm.y(), 1e-12);

    const Vector3d point = camera.source_point + 400.0 * axes.col(2) + 30.0 * axes.col(1);
    const Vector3d pixels = projection_matrix_of(camera) * point.homogeneous();
    EXPECT_LT((pixels.hnormalized() - camera.project(point)).norm(), kPinholePx);
    EXPECT_NEAR(pixels.z(), 400.0, kPinholeMm);  // w is the depth in mm
  }
}

TEST(PinholeCamera, SpacingMovesTheDetectorOnly) {
  const CameraGeometry camera = camera_from_pinhole("A", some_pinhole(), 0.5, {512, 400});
  const CameraGeometry moved = with_column_spacing(camera, 1.0);
  EXPECT_NEAR(moved.source_detector_distance_mm(), 1200.0, kPinholeMm);
  EXPECT_LT((moved.ray(17.0, 301.0).direction - camera.ray(17.0, 301.0).direction).norm(), 1e-14);
}

TEST(PinholeCamera, RefusesWhatIsNone) {
  const auto refusal = [](const auto& change) {
    PinholeCamera pinhole = some_pinhole();
    change(pinhole);
    return test::message_of<InputError>([&] {
      (void)camera_from_pinhole("A", pinhole, 0.5, {512, 400});
    });
  };
  EXPECT_THAT(refusal([](PinholeCamera& p) { p.pixels_from_camera(0, 1) = 3.0; }),
              HasSubstr("no skew"));
  EXPECT_THAT(refusal([](PinholeCamera& p) { p.pixels_from_camera(0, 0) = 0.0; }),
              HasSubstr("focal lengths"));
  EXPECT_THAT(refusal([](PinholeCamera& p) { p.pixels_from_camera.transposeInPlace(); }),
              HasSubstr("[0, 0, 1]"));
  EXPECT_THAT(refusal([](PinholeCamera& p) { p.pixels_from_camera(1, 2) = std::nan(""); }),
              HasSubstr("finite"));
  EXPECT_THAT(refusal([](PinholeCamera& p) { p.camera_from_room.row(1) *= -1.0; }),
              HasSubstr("rotation"));
  EXPECT_THAT(refusal([](PinholeCamera& p) { p.camera_from_room *= 1.01; }), HasSubstr("rotation"));
  EXPECT_THAT(refusal([](PinholeCamera& p) { p.translation_mm.x() = std::nan(""); }),
              HasSubstr("finite"));
}

}  // namespace
}  // namespace af
