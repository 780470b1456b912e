// SPDX-License-Identifier: Apache-2.0
#include "benchmark/viewpoint_cylinder.h"

#include <cmath>

#include <gtest/gtest.h>

#include "base/hash_random.h"
#include "geometry/ct_box.h"
#include "support/c_arm_camera.h"

namespace af::benchmark {
namespace {

Eigen::Vector3d anywhere(HashRandom& random, double size) {
  return {random.uniform(-size, size), random.uniform(-size, size), random.uniform(-size, size)};
}

OrbitScene random_scene(HashRandom& random) {
  OrbitScene scene;
  scene.frame.rotation = rotation_from_angles(anywhere(random, 0.6));
  scene.frame.center_ct_mm = anywhere(random, 40.0);
  scene.frame.center_room_mm = anywhere(random, 20.0);
  scene.isocenter_point = anywhere(random, 20.0);
  scene.camera = test::moved_camera(
      test::paper_camera(), rotation_from_angles(anywhere(random, 0.1)), anywhere(random, 10.0));
  for (int axis = 0; axis < 3; ++axis) {
    scene.range.low.rotation_rad[axis] = -random.uniform(0.0, 0.17);
    scene.range.high.rotation_rad[axis] = random.uniform(0.0, 0.17);
    scene.range.low.translation_mm[axis] = -random.uniform(0.0, 30.0);
    scene.range.high.translation_mm[axis] = random.uniform(0.0, 30.0);
  }
  scene.orbit.from_rad = -random.uniform(0.0, 1.5);
  scene.orbit.to_rad = random.uniform(0.0, 1.5);
  const Eigen::Vector3d half = Eigen::Vector3d::Constant(90.0);
  scene.attenuating_corners_ct =
      CtBox{scene.frame.center_ct_mm - half, scene.frame.center_ct_mm + half}.corner_points();
  scene.depth_slabs = [](const RigidTransform& /*slab_from_ct*/) {
    return DepthSlabs{{-20.0, 30.0}, {-55.0, 5.0, 60.0}};
  };
  return scene;
}

/// A pose within the range. Every other one has some parameters at their bounds.
PoseParameters pose_or_bounds(const MotionRange& range, HashRandom& random) {
  const double at_bounds = random.uniform() < 0.5 ? 0.6 : 0.0;
  const auto between = [&](double low, double high) {
    const double share = random.uniform();
    if (random.uniform() < at_bounds) return share < 0.5 ? low : high;
    return low + share * (high - low);
  };
  PoseParameters pose;
  for (int axis = 0; axis < 3; ++axis) {
    pose.rotation_rad[axis] = between(range.low.rotation_rad[axis], range.high.rotation_rad[axis]);
    pose.translation_mm[axis] =
        between(range.low.translation_mm[axis], range.high.translation_mm[axis]);
  }
  return pose;
}

/// Whether both columns beside a ray hold it in all slabs.
testing::AssertionResult holds(const ViewpointCylinder& cylinder, const Ray& ray_ct) {
  const auto place = cylinder.columns_of(ray_ct);
  if (!place) return testing::AssertionFailure() << "beyond the columns";
  for (int i = 0; i < 2; ++i) {
    const LightSlab& column = cylinder.columns()[static_cast<std::size_t>(place->lower + i)];
    const Ray ray{column.slab_from_ct * ray_ct.origin_point,
                  column.slab_from_ct.linear() * ray_ct.direction};
    for (const SlabGeometry& slab : column.slabs)
      if (!column.intersect(ray, slab))
        return testing::AssertionFailure() << "missed by column " << place->lower + i;
  }
  return testing::AssertionSuccess();
}

TEST(ViewpointCylinder, HoldsEveryRayOfTheOrbit) {
  constexpr int kScenes = 10;
  constexpr int kPosesEach = 1000;
  constexpr double kStepRad = 8.0 * kRadPerDeg;
  HashRandom random(61);
  for (int i = 0; i < kScenes; ++i) {
    const OrbitScene scene = random_scene(random);
    const ViewpointCylinder cylinder(scene, kStepRad);
    for (int p = 0; p < kPosesEach; ++p) {
      const double angle = p % 5 == 0   ? scene.orbit.from_rad
                           : p % 5 == 1 ? scene.orbit.to_rad
                                        : random.uniform(scene.orbit.from_rad, scene.orbit.to_rad);
      const CameraGeometry camera =
          turned_camera(scene.camera, scene.isocenter_point, scene.orbit.direction(), angle);
      const RigidTransform ct_from_room =
          pose_from_parameters(scene.frame, pose_or_bounds(scene.range, random)).inverse();
      const Eigen::Vector3d source = ct_from_room * camera.source_point;
      for (const Eigen::Vector3d& corner : camera.detector_corner_points())
        ASSERT_TRUE(holds(cylinder, {source, ct_from_room * corner - source}))
            << "scene " << i << ", pose " << p;
      const Eigen::Vector2d pixel(random.uniform(0.0, 1.0), random.uniform(0.0, 1.0));
      const Eigen::Vector3d inside = camera.detector_point(pixel.x() * camera.size_px.x() - 0.5,
                                                           pixel.y() * camera.size_px.y() - 0.5);
      ASSERT_TRUE(holds(cylinder, {source, ct_from_room * inside - source}))
          << "scene " << i << ", pose " << p;
    }
  }
}

TEST(ViewpointCylinder, ACameraTurnedToAColumnLooksFromThere) {
  HashRandom random(67);
  const OrbitScene scene = random_scene(random);
  const ViewpointCylinder cylinder(scene, 8.0 * kRadPerDeg);
  const RigidTransform ct_from_room = scene.frame.nominal_room_from_ct().inverse();
  const Eigen::Vector3d isocenter_ct = ct_from_room * scene.isocenter_point;
  for (int i = 0; i < static_cast<int>(cylinder.columns().size()); ++i) {
    const CameraGeometry camera = turned_camera(
        scene.camera, scene.isocenter_point, scene.orbit.direction(), cylinder.angle_rad(i));
    const Eigen::Vector3d source = ct_from_room * camera.source_point;
    const auto place = cylinder.columns_of({source, isocenter_ct - source});
    constexpr double kRounding = 1e-9;
    // Rounding may put the outermost one beyond the columns.
    if (!place) continue;
    EXPECT_NEAR(place->lower + place->weight, i, kRounding);
    const LightSlab& column = cylinder.columns()[static_cast<std::size_t>(i)];
    const Eigen::Vector3d in_column = column.slab_from_ct * source;
    EXPECT_NEAR(in_column.x(), cylinder.viewpoint_x_mm(i), kRounding);
    EXPECT_NEAR(in_column.y(), column.uv_plane_y_mm, 1e-6);
    // Halfway to the next one.
    if (i + 1 == static_cast<int>(cylinder.columns().size())) continue;
    const double between = 0.5 * (cylinder.angle_rad(i) + cylinder.angle_rad(i + 1));
    const Eigen::Vector3d beside =
        ct_from_room *
        turned_camera(scene.camera, scene.isocenter_point, scene.orbit.direction(), between)
            .source_point;
    const auto halfway = cylinder.columns_of({beside, isocenter_ct - beside});
    ASSERT_TRUE(halfway.has_value());
    EXPECT_EQ(halfway->lower, i);
    EXPECT_NEAR(halfway->weight, 0.5, kRounding);
  }
}

}  // namespace
}  // namespace af::benchmark
