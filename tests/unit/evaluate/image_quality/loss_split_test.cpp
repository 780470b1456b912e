// SPDX-License-Identifier: Apache-2.0
#include "evaluate/image_quality/loss_split.h"

#include <array>
#include <cmath>

#include <gtest/gtest.h>

#include "drr/ray_cast_drr.h"
#include "geometry/ct_box.h"
#include "geometry/slab_sizing.h"
#include "support/c_arm_camera.h"
#include "support/ct_phantoms.h"
#include "support/cube_grid.h"

namespace af::evaluation {
namespace {

using Eigen::Vector3d;

constexpr RayCasterOptions kCaster{1.0};

/// 24 x 20 pixels of 8 mm on a C-arm, beam along +y.
CameraGeometry camera() {
  return test::c_arm_camera(24, 20, 8.0);
}

std::shared_ptr<const AttenuationVolume> ellipsoids() {
  const CtVolume ct =
      ellipsoid_phantom(test::cube_grid(32, 3.0),
                        {{{0, 0, 0}, {38, 30, 34}, Eigen::Matrix3d::Identity(), 0},
                         {{12, -8, 10}, {9, 6, 14}, Eigen::Matrix3d::Identity(), 900},
                         {{-14, 9, -6}, {7, 12, 8}, Eigen::Matrix3d::Identity(), 700}},
                        2);
  return std::make_shared<const AttenuationVolume>(ct, AttenuationModel{});
}

LightSlab light_slab(int uv_nodes, int st_nodes) {
  const CtBox box{Vector3d::Constant(-48.0), Vector3d::Constant(48.0)};
  LightSlabSpec spec;
  spec.uv_nodes = uv_nodes;
  spec.st_nodes = st_nodes;
  return make_light_slab(camera(), PoseFrame{}, {0.15, 15.0}, box.corner_points(), spec);
}

RigidTransform pose() {
  return pose_from_parameters(PoseFrame{},
                              PoseParameters::from_deg_and_mm({3.0, -4.0, 5.0, 7.0, -9.0, 4.0}));
}

/// Lower nodes and weights of a ray on a plane of two axes.
struct PlaneTap {
  std::array<int, 2> node{};
  std::array<double, 2> weight{};

  PlaneTap(double a, double b)
      : node{static_cast<int>(a), static_cast<int>(b)}, weight{a - node[0], b - node[1]} {}

  /// The weighted mean over the four nodes around.
  template <typename Value>
  [[nodiscard]] double mean_of(Value value) const {
    double sum = 0.0;
    for (const int i : {0, 1})
      for (const int j : {0, 1})
        sum += (i == 0 ? 1.0 - weight[0] : weight[0]) * (j == 0 ? 1.0 - weight[1] : weight[1]) *
               value(node[0] + i, node[1] + j);
    return sum;
  }
};

/// One pixel, ray by ray.
class PixelOracle {
 public:
  PixelOracle(const AttenuationVolume& volume, const LightSlab& light_slab)
      : caster_(volume, kCaster),
        light_slab_(light_slab),
        slab_(light_slab.slabs.front()),
        ct_from_slab_(light_slab.slab_from_ct.inverse()),
        slab_from_room_(light_slab.slab_from_ct * pose().inverse()),
        source_(slab_from_room_ * camera().source_point) {}

  [[nodiscard]] double value(int column, int row, InterpolatedPlanes planes) const {
    const Vector3d through = slab_from_room_ * camera().detector_point(column, row);
    const RayNodes nodes = nodes_towards(through);
    const Vector3d at_st = source_ + (slab_.st_plane_y_mm - source_.y()) / (through - source_).y() *
                                         (through - source_);
    if (planes == InterpolatedPlanes::Uv) return blended(at_st);
    return PlaneTap(nodes.s, nodes.t).mean_of([&](int s, int t) {
      const Vector3d node = light_slab_.st_point(slab_, s, t);
      return planes == InterpolatedPlanes::St ? cast(source_, node) : blended(node);
    });
  }

 private:
  [[nodiscard]] RayNodes nodes_towards(const Vector3d& point) const {
    return light_slab_.intersect({source_, point - source_}, slab_).value();
  }
  [[nodiscard]] double cast(const Vector3d& from, const Vector3d& through) const {
    return static_cast<double>(
        caster_.total_attenuation(ct_from_slab_ * from, ct_from_slab_ * through));
  }
  /// What the viewpoints around the source's ray to a point see through that point.
  [[nodiscard]] double blended(const Vector3d& st_point) const {
    const RayNodes nodes = nodes_towards(st_point);
    return PlaneTap(nodes.u, nodes.v).mean_of([&](int u, int v) {
      return cast(light_slab_.viewpoint(u, v), st_point);
    });
  }

  RayCaster caster_;
  LightSlab light_slab_;
  SlabGeometry slab_;
  RigidTransform ct_from_slab_;
  RigidTransform slab_from_room_;
  Vector3d source_;
};

TEST(InterpolatedRayCast, EqualsTheRaysThroughTheNodesAround) {
  const auto volume = ellipsoids();
  const LightSlab nodes = light_slab(8, 24);
  const View view = View::whole_detector(camera());
  // The same lines, reached through other points: positions in single precision, 1e-5 of a voxel
  // at most, where a voxel's step is 0.06 in U.
  constexpr double kTolerance = 1e-4;
  const PixelOracle oracle(*volume, nodes);
  for (const auto planes :
       {InterpolatedPlanes::Uv, InterpolatedPlanes::St, InterpolatedPlanes::Both}) {
    const Image2d image =
        render_image(InterpolatedRayCast(volume, kCaster, nodes, planes), pose(), view);
    double largest = 0.0;
    for (int row = 0; row < 20; row += 3)
      for (int column = 0; column < 24; ++column) {
        const double expected = oracle.value(column, row, planes);
        EXPECT_NEAR(static_cast<double>(image.at(column, row)), expected, kTolerance)
            << column << ", " << row << ", planes " << static_cast<int>(planes);
        largest = std::max(largest, expected);
      }
    EXPECT_GT(largest, 1.0);
  }
}

TEST(InterpolatedRayCast, CountsRaysOutsideAndShowsNothing) {
  const auto volume = ellipsoids();
  const InterpolatedRayCast renderer(volume, kCaster, light_slab(8, 24), InterpolatedPlanes::Uv);
  const RigidTransform far = pose_from_parameters(
      PoseFrame{}, PoseParameters::from_deg_and_mm({0.0, 0.0, 0.0, 300.0, 0.0, 0.0}));
  std::int64_t rays_outside = 0;
  const Image2d image = render_image(renderer, far, View::whole_detector(camera()), &rays_outside);
  EXPECT_GT(rays_outside, 0);
  for (const float value : image.pixels) EXPECT_EQ(value, 0.0f);
}

TEST(LossSplitter, AFieldWithoutQuantisationLosesByInterpolationAlone) {
  const auto volume = ellipsoids();
  const RayCastDrr reference(volume, kCaster);
  const View view = View::whole_detector(camera());
  const auto split_with = [&](int uv_nodes, int st_nodes) {
    const LightSlab nodes = light_slab(uv_nodes, st_nodes);
    const InterpolatedRayCast field(volume, kCaster, nodes, InterpolatedPlanes::Both);
    return LossSplitter(field, reference, field, view).at_pose(pose());
  };
  const LossSplit coarse = split_with(8, 24);
  EXPECT_EQ(coarse.mean_square[3], 0.0);
  EXPECT_EQ(coarse.mean_square[4], coarse.mean_square[2]);
  EXPECT_EQ(coarse.psnr_db()[4], -10.0 * std::log10(coarse.mean_square[4]));
  // Finer nodes on one plane lower that plane's loss and leave the other's.
  const LossSplit fine_uv = split_with(64, 24);
  EXPECT_LT(fine_uv.mean_square[0], 0.1 * coarse.mean_square[0]);
  EXPECT_EQ(fine_uv.mean_square[1], coarse.mean_square[1]);
  const LossSplit fine_st = split_with(8, 192);
  EXPECT_LT(fine_st.mean_square[1], 0.1 * coarse.mean_square[1]);
  EXPECT_EQ(fine_st.mean_square[0], coarse.mean_square[0]);
}

}  // namespace
}  // namespace af::evaluation
