// SPDX-License-Identifier: Apache-2.0
#include "precompute/casting/field_caster.h"

#include <gtest/gtest.h>

#include "base/vector_width.h"
#include "geometry/ct_box.h"
#include "precompute/casting/trilinear_caster.h"
#include "precompute/casting/unit_costs.h"
#include "precompute/casting/unit_planner.h"
#include "support/cast_plan.h"
#include "support/ct_phantoms.h"

namespace af {
namespace {

constexpr double kHalfPi = 1.5707963267948966;

/// A box of water and denser stuff in a tilted grid.
CtVolume small_ct() {
  CtGrid grid;
  grid.size = {20, 17, 15};
  grid.spacing_mm = {3.0, 4.0, 5.0};
  grid.direction = rotation_from_angles({0.1, -0.2, 0.3});
  grid.origin_mm = -grid.point_mm(Eigen::Vector3d(9.5, 8.0, 7.0));
  return box_phantom(grid, {3, 3, 3}, {15, 12, 11}, 300);
}

/// 5 x 4 viewpoints, (s,t) lattice of 14 x 11 nodes of which a part is stored.
LightSlab small_light_slab() {
  LightSlab light_slab;
  light_slab.slab_from_ct.linear() = rotation_from_angles({0.2, kHalfPi, -0.1});
  light_slab.slab_from_ct.translation() = Eigen::Vector3d(1.0, -2.0, 3.0);
  light_slab.uv_plane_y_mm = 500.0;
  light_slab.u = {-80.0, 90.0, 5};
  light_slab.v = {-70.0, 60.0, 4};
  SlabGeometry slab;
  slab.s = {-60.0, 60.0, 14};
  slab.t = {-50.0, 55.0, 11};
  slab.stored_s = {2, 10};
  slab.stored_t = {4, 7};
  light_slab.slabs.push_back(slab);
  return light_slab;
}

class TrilinearFieldCasterTest : public testing::Test {
 protected:
  RayCasterOptions options_{2.0};
  AttenuationVolume volume_{small_ct(), AttenuationModel{}};
  AttenuationQuantizer quantizer_ =
      AttenuationQuantizer::for_maximum(volume_.max_total_attenuation());
  LightSlab light_slab_ = small_light_slab();
};

TEST_F(TrilinearFieldCasterTest, SamplesEqualSingleRays) {
  const TrilinearFieldCaster caster(volume_, light_slab_, quantizer_, options_);
  const RayCaster single(volume_, options_);
  const RigidTransform ct_from_slab = light_slab_.slab_from_ct.inverse();
  int occupied = 0;
  // A single ray is set up from other, equal points, so its positions differ by rounding (1e-13 mm)
  // and, when that turns over the number of samples, by the caster's own error. Two levels cover
  // the former; the step of 2 mm in a box of some 40 mm bounds the latter by a few percent.
  constexpr int kRounding = 2;
  int turned_over = 0;
  for (const auto& [node, sample] : cast_plan(caster, light_slab_, {100})) {
    const auto [u, v, s, t] = node;
    const float direct =
        single.total_attenuation(ct_from_slab * light_slab_.viewpoint(u, v),
                                 ct_from_slab * light_slab_.st_point(light_slab_.slabs[0], s, t));
    occupied += direct > 0.0f ? 1 : 0;
    const int difference = std::abs(int{sample} - int{quantizer_.quantize(direct)});
    turned_over += difference > kRounding ? 1 : 0;
    EXPECT_NEAR(quantizer_.dequantize(sample), direct, 0.05);
  }
  EXPECT_GT(occupied, 300);
  EXPECT_LE(turned_over, 3);
}

TEST_F(TrilinearFieldCasterTest, SamplesDoNotDependOnThePlanOrTheVectorWidth) {
  const TrilinearFieldCaster caster(volume_, light_slab_, quantizer_, options_);
  const NodeSamples expected = cast_plan(caster, light_slab_, {1000000});
  for (const VectorWidth width : supported_vector_widths()) {
    force_vector_width(width);
    for (const std::int64_t rays_per_unit : {1, 120, 400})
      EXPECT_EQ(cast_plan(caster, light_slab_, {rays_per_unit}), expected);
  }
  force_vector_width(std::nullopt);
}

TEST_F(TrilinearFieldCasterTest, RaysRunPastThePlane) {
  // The (s,t) plane lies above the whole CT, so rays meet nothing before it.
  light_slab_.slabs[0].st_plane_y_mm = 300.0;
  const TrilinearFieldCaster caster(volume_, light_slab_, quantizer_, options_);
  const NodeSamples samples = cast_plan(caster, light_slab_, {1000000});
  EXPECT_TRUE(std::any_of(
      samples.begin(), samples.end(), [](const auto& sample) { return sample.second > 0; }));
}

TEST_F(TrilinearFieldCasterTest, SlabsSumToTheWhole) {
  const TrilinearFieldCaster whole(volume_, light_slab_, quantizer_, options_);
  const NodeSamples expected = cast_plan(whole, light_slab_, {1000000});
  LightSlab cut = light_slab_;
  cut.slabs.assign(3, light_slab_.slabs[0]);
  cut.slabs[0].y_high_mm = cut.slabs[1].y_low_mm = -8.0;
  cut.slabs[1].y_high_mm = cut.slabs[2].y_low_mm = 5.5;
  const TrilinearFieldCaster caster(volume_, cut, quantizer_, options_);
  std::map<Node, double> sums;
  int in_all_slabs = 0;
  for (std::size_t k = 0; k < 3; ++k)
    for (const auto& [node, sample] : cast_plan(caster, cut, {1000000}, k)) {
      sums[node] += static_cast<double>(quantizer_.dequantize(sample));
      in_all_slabs += sample > 0 ? 1 : 0;
    }
  // Steps of up to 2 mm meet the faces of the box (mu = 0.026) at other places in each slab.
  constexpr double kStepping = 4.0 * 2.0 * 0.026 / 2.0;
  for (const auto& [node, sample] : expected)
    EXPECT_NEAR(sums[node], quantizer_.dequantize(sample), kStepping);
  EXPECT_GT(in_all_slabs, 1000);
}

TEST(UnitCosts, RaysThroughTheBoxCostMoreThanRaysBesideIt) {
  LightSlab light_slab;
  light_slab.uv_plane_y_mm = 650.0;
  light_slab.u = light_slab.v = {-10.0, 10.0, 4};
  SlabGeometry slab;
  slab.s = slab.t = {-10.0, 10.0, 40};
  slab.stored_s = slab.stored_t = {0, 40};
  light_slab.slabs.push_back(slab);
  const auto units = plan_units(light_slab.lattice(), {4 * 2 * 2 * kRunOfT});
  const CtBox box{{-9.0, -1.0, -1.0}, {-2.0, 1.0, 9.0}};
  const auto costs = unit_costs(units, light_slab, box.corner_points());
  double beside = 0.0;
  double inside = 0.0;
  for (std::size_t i = 0; i < units.size(); ++i) {
    const double cost = costs[i] / static_cast<double>(units[i].sample_count());
    // The lattice spans -10 to 10 mm in x; the box ends at -2 mm, and its shadow moves by up to
    // 20 mm * 1 mm / 650 mm.
    if (light_slab.slabs[0].s.position_mm(units[i].s.begin) > -1.9) beside = std::max(beside, cost);
    inside = std::max(inside, cost);
  }
  EXPECT_GT(inside, 5.0 * beside);
  EXPECT_GT(beside, 0.0);
}

}  // namespace
}  // namespace af
