// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include <gtest/gtest.h>

#include "base/hash_random.h"
#include "geometry/ct_box.h"
#include "geometry/slab_sizing.h"
#include "support/c_arm_camera.h"

namespace af {
namespace {

Eigen::Vector3d anywhere(HashRandom& random, double size) {
  return {random.uniform(-size, size), random.uniform(-size, size), random.uniform(-size, size)};
}

/// A camera and a range to test.
struct RandomSetting {
  PoseFrame frame;
  CameraGeometry camera;
  MotionRange range;

  explicit RandomSetting(HashRandom& random) {
    frame.rotation = rotation_from_angles(anywhere(random, 0.6));
    frame.center_ct_mm = anywhere(random, 40.0);
    frame.center_room_mm = anywhere(random, 10.0);
    camera = test::moved_camera(
        test::paper_camera(), rotation_from_angles(anywhere(random, 3.0)), anywhere(random, 10.0));
    for (int axis = 0; axis < 3; ++axis) {
      range.low.rotation_rad[axis] = -random.uniform(0.0, 0.2);
      range.high.rotation_rad[axis] = random.uniform(0.0, 0.2);
      range.low.translation_mm[axis] = -random.uniform(0.0, 40.0);
      range.high.translation_mm[axis] = random.uniform(0.0, 40.0);
    }
  }

  [[nodiscard]] RigidTransform pose(HashRandom& random) const {
    PoseParameters parameters;
    for (int axis = 0; axis < 3; ++axis) {
      const auto between = [&](double low, double high) {
        const double share = random.uniform();
        if (random.uniform() < 0.4) return share < 0.5 ? low : high;
        return low + share * (high - low);
      };
      parameters.rotation_rad[axis] =
          between(range.low.rotation_rad[axis], range.high.rotation_rad[axis]);
      parameters.translation_mm[axis] =
          between(range.low.translation_mm[axis], range.high.translation_mm[axis]);
    }
    return pose_from_parameters(frame, parameters);
  }
  [[nodiscard]] Eigen::Vector3d source_ct(const RigidTransform& room_from_ct) const {
    return room_from_ct.inverse() * camera.source_point;
  }
  [[nodiscard]] LightSlab planes(const std::vector<HalfSpace>& sources) const {
    LightSlabSpec spec;
    spec.slab_boundaries_y_mm = {-20.0, 30.0};
    spec.st_plane_y_mm = {-60.0, 0.0, 55.0};
    spec.sources = sources;
    const Eigen::Vector3d half = Eigen::Vector3d::Constant(90.0);
    return make_light_slab(
        camera,
        frame,
        range,
        CtBox{frame.center_ct_mm - half, frame.center_ct_mm + half}.corner_points(),
        spec);
  }
};

bool contains(const std::vector<HalfSpace>& all, const Eigen::Vector3d& point) {
  return std::ranges::all_of(all, [&](const HalfSpace& half) { return half.contains(point); });
}

TEST(SourceRegion, NoRayFromWithinMissesTheNarrowedPlanes) {
  constexpr int kSettings = 100;
  constexpr int kPosesEach = 400;
  HashRandom random(59);
  int within = 0;
  int narrower = 0;
  for (int setting = 0; setting < kSettings; ++setting) {
    const RandomSetting drawn(random);
    std::vector<HalfSpace> sources;
    for (int i = 0; i < 1 + setting % 3; ++i) {
      // The bound passes through a pose's source. Normals need not be unit vectors.
      const Eigen::Vector3d normal = anywhere(random, 2.0);
      sources.push_back({normal, normal.dot(drawn.source_ct(drawn.pose(random)))});
    }
    const LightSlab planes = drawn.planes(sources);
    const LightSlab of_all = drawn.planes({});
    if (planes.u.last_mm - planes.u.first_mm < 0.95 * (of_all.u.last_mm - of_all.u.first_mm))
      ++narrower;
    for (int i = 0; i < kPosesEach; ++i) {
      const RigidTransform pose = drawn.pose(random);
      if (!contains(sources, drawn.source_ct(pose))) continue;
      ++within;
      const RigidTransform slab_from_room = planes.slab_from_ct * pose.inverse();
      const Eigen::Vector3d source = slab_from_room * drawn.camera.source_point;
      for (const Eigen::Vector3d& corner : drawn.camera.detector_corner_points())
        for (const SlabGeometry& slab : planes.slabs)
          ASSERT_TRUE(planes.intersect({source, slab_from_room * corner - source}, slab))
              << setting << ", " << i;
    }
  }
  EXPECT_GT(within, 10000);
  EXPECT_GT(narrower, kSettings / 4);
}

/// Without turns all rays to a corner of the detector are parallel. So bounds of the source are
/// bounds of the hit, in closed form.
TEST(SourceRegion, IsExactWhereTheCtOnlyShifts) {
  const MotionRange range{0.0, 30.0};
  const CameraGeometry camera = test::paper_camera();
  const PoseFrame frame;
  LightSlabSpec spec;
  const auto corners =
      CtBox{Eigen::Vector3d::Constant(-90.0), Eigen::Vector3d::Constant(90.0)}.corner_points();
  const LightSlab of_all = make_light_slab(camera, frame, range, corners, spec);
  // Along x of the slab frame, at most 10 mm beside the nominal source, and not below -20.
  const Eigen::Vector3d x_ct = of_all.slab_from_ct.linear().transpose() * Eigen::Vector3d::UnitX();
  const double nominal = x_ct.dot(camera.source_point);
  spec.sources = {{x_ct, nominal + 10.0}, {-2.0 * x_ct, -2.0 * (nominal - 20.0)}};
  const LightSlab part = make_light_slab(camera, frame, range, corners, spec);
  constexpr double kMarginMm = 400.0 * kExtentMargin;
  EXPECT_NEAR(part.u.last_mm, of_all.u.last_mm - 20.0, kMarginMm);
  EXPECT_NEAR(part.u.first_mm, of_all.u.first_mm + 10.0, kMarginMm);
  EXPECT_NEAR(part.v.first_mm, of_all.v.first_mm, kMarginMm);
  EXPECT_NEAR(part.v.last_mm, of_all.v.last_mm, kMarginMm);
  EXPECT_LT(part.u.nodes, part.v.nodes);
  EXPECT_LE(part.u.spacing_mm(), part.v.spacing_mm());
}

}  // namespace
}  // namespace af
