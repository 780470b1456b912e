// SPDX-License-Identifier: Apache-2.0
#include "geometry/point_distances.h"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "base/hash_random.h"
#include "base/vector_width.h"
#include "unit/geometry/camera_at.h"

namespace af {
namespace {

using Eigen::Vector3d;

/// Some points within 60 mm; their number is no multiple of the kernel's eight.
std::vector<Vector3d> some_points(std::uint64_t count) {
  HashRandom random(7, count, 0);
  std::vector<Vector3d> points(count);
  for (Vector3d& point : points)
    for (int axis = 0; axis < 3; ++axis) point[axis] = random.uniform(-60.0, 60.0);
  return points;
}

const RigidTransform kGold =
    pose_from_parameters(PoseFrame{}, PoseParameters::from_deg_and_mm({20, -40, 70, 5, -8, 3}));
const RigidTransform kPose =
    pose_from_parameters(PoseFrame{}, PoseParameters::from_deg_and_mm({21, -43, 71, 9, -6, 15}));

class PointDistances : public testing::Test {
 protected:
  void TearDown() override { force_vector_width(std::nullopt); }
};

TEST_F(PointDistances, SumLengthsAsPointByPointWithTheSameBitsAtEveryWidth) {
  for (const std::uint64_t count : {1u, 2u, 7u, 8u, 9u, 27u, 1000u}) {
    const std::vector<Vector3d> points = some_points(count);
    double expected = 0.0;
    for (const Vector3d& point : points) expected += (kPose * point).norm();
    std::vector<double> sums;
    for (const VectorWidth width : supported_vector_widths()) {
      force_vector_width(width);
      sums.push_back(sum_of_lengths_mm(points, kPose.linear(), kPose.translation()));
      EXPECT_EQ(sums.back(), sums.front());
    }
    // A thousand additions of values below 120.
    EXPECT_NEAR(sums.front(), expected, 1e-8) << count;
  }
  EXPECT_EQ(sum_of_lengths_mm({}, kPose.linear(), kPose.translation()), 0.0);
}

TEST_F(PointDistances, ProjectAsTheCameraDoesWithTheSameBitsAtEveryWidth) {
  const CameraGeometry camera = test::camera_at("A", {0, -800, 0}, Vector3d::UnitX());
  for (const std::uint64_t count : {1u, 9u, 1000u}) {
    const std::vector<Vector3d> points = some_points(count);
    double reprojection_mm = 0.0;
    double detector_mm = 0.0;
    for (const Vector3d& point : points) {
      const Vector3d here = kPose * point;
      const Vector3d gold = kGold * point;
      const Vector3d direction = (here - camera.source_point).normalized();
      reprojection_mm += (gold - camera.source_point).cross(direction).norm();
      detector_mm += (camera.project(here) - camera.project(gold))
                         .cwiseProduct(camera.pixel_spacing_mm)
                         .norm();
    }
    std::vector<ProjectionDistances> sums;
    for (const VectorWidth width : supported_vector_widths()) {
      force_vector_width(width);
      sums.push_back(projection_distances(camera, points, kPose, kGold));
      EXPECT_EQ(sums.back().reprojection_mm, sums.front().reprojection_mm);
      EXPECT_EQ(sums.back().detector_mm, sums.front().detector_mm);
    }
    // A thousand additions; each distance is a difference of coordinates of 1000 mm.
    EXPECT_NEAR(sums.front().reprojection_mm, reprojection_mm, 1e-8) << count;
    EXPECT_NEAR(sums.front().detector_mm, detector_mm, 1e-8) << count;
  }
}

TEST_F(PointDistances, BehindTheSourceDoNotExist) {
  const CameraGeometry camera = test::camera_at("A", {0, -800, 0}, Vector3d::UnitX());
  std::vector<Vector3d> points = some_points(20);
  const RigidTransform identity = RigidTransform::Identity();
  points[11] = 1.1 * camera.source_point;
  for (const VectorWidth width : supported_vector_widths()) {
    force_vector_width(width);
    EXPECT_TRUE(
        std::isnan(projection_distances(camera, points, identity, identity).reprojection_mm));
    EXPECT_TRUE(std::isnan(projection_distances(camera, points, identity, identity).detector_mm));
  }
}

}  // namespace
}  // namespace af
