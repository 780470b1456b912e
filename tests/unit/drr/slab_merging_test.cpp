// SPDX-License-Identifier: Apache-2.0
#include "drr/slab_merging.h"

#include <cmath>

#include <gtest/gtest.h>

#include "base/hash_random.h"
#include "unit/drr/small_fields.h"

namespace af {
namespace {

double noise_of_node(const RayNodes& n) {
  const auto key = static_cast<std::uint64_t>(n.u + 100 * (n.v + 100 * (n.s + 100 * n.t)));
  return std::floor(20000.0 * HashRandom(3, key).uniform());
}

struct MergedSlab {
  SlabGeometry geometry;
  std::vector<std::uint16_t> samples;

  explicit MergedSlab(const FieldLevel& level) {
    const SlabMerging merging(level.field_geometry, level.slabs);
    geometry = merging.geometry();
    const std::size_t count = static_cast<std::size_t>(geometry.stored_s.count) *
                              static_cast<std::size_t>(geometry.stored_t.count);
    samples.resize(level.viewpoint_count() * count);
    std::span<std::uint16_t> left = samples;
    for (int u = 0; u < level.field_geometry.u.nodes; ++u)
      for (int v = 0; v < level.field_geometry.v.nodes; ++v, left = left.subspan(count))
        merging.merge(u, v, left.first(count));
  }
  [[nodiscard]] int at(int viewpoint, int s, int t) const {
    const int row = viewpoint * geometry.stored_t.count + t - geometry.stored_t.begin;
    return samples[static_cast<std::size_t>(row * geometry.stored_s.count + s -
                                            geometry.stored_s.begin)];
  }
};

TEST(SlabMerging, OfSlabsInOnePlaneIsTheSumOfTheHalves) {
  FieldLevel fine = decode_field(small_field(noise_of_node, 1, 4, 16));
  const FieldLevelSlab half =
      next_field_level(std::make_shared<const FieldLevel>(fine)).slabs[0];  // of one slab: halved
  fine.slabs.push_back(fine.slabs[0]);
  const MergedSlab merged(fine);
  EXPECT_DOUBLE_EQ(merged.geometry.s.first_mm, half.geometry.s.first_mm);
  EXPECT_DOUBLE_EQ(merged.geometry.t.last_mm, half.geometry.t.last_mm);
  ASSERT_EQ(merged.samples.size(), half.samples.size() - kFieldLevelPadding);
  for (std::size_t i = 0; i < merged.samples.size(); ++i)
    // Halving rounds each slab, merging their sum.
    EXPECT_NEAR(merged.samples[i], 2 * half.samples.view()[i], 1) << i;
}

TEST(SlabMerging, PlaneLiesAtTheCentroidOfAttenuation) {
  FieldLevel level = decode_field(small_field([](const RayNodes&) { return 3000.0; }, 2, 4, 16));
  const double near_y = level.slabs[0].geometry.st_plane_y_mm;
  const double far_y = level.slabs[1].geometry.st_plane_y_mm;
  EXPECT_NEAR(MergedSlab(level).geometry.st_plane_y_mm, 0.5 * (near_y + far_y), 1e-3);
  // 2 slabs of 4x4 x 16x16 nodes, none of them padding.
  EXPECT_EQ(level.slabs[1].weight, 3000.0 * 4 * 4 * 16 * 16);
  level.slabs[1].weight *= 3.0;
  EXPECT_NEAR(MergedSlab(level).geometry.st_plane_y_mm, 0.25 * near_y + 0.75 * far_y, 1e-3);
}

/// Here each slab shows a function of the position on its plane. Every viewpoint must see it at
/// that position, wherever the merged plane lies. The taps interpolate a cubic exactly; their blur
/// adds its second derivative times half their variance.
TEST(SlabMerging, SeesEachSlabWhereItIsFromEveryViewpoint) {
  constexpr int kNodes = 32;
  const auto bump = [](double s, double t) {
    const double x = (s - 15.5) / 16.0;
    const double z = (t - 15.5) / 16.0;
    return 9000.0 + 4000.0 * (x * x * x - x) + 2000.0 * z * z + 1500.0 * x * z;
  };
  const FieldLevel level = decode_field(
      small_field([&](const RayNodes& n) { return std::round(bump(n.s, n.t)); }, 2, 4, kNodes));
  const MergedSlab merged(level);
  const double uv_y = level.field_geometry.uv_plane_y_mm;
  int compared = 0;
  for (int u = 0; u < 4; ++u)
    for (int v = 0; v < 4; ++v)
      for (int s = 0; s < merged.geometry.s.nodes; ++s)
        for (int t = 0; t < merged.geometry.t.nodes; ++t) {
          const Eigen::Vector3d from = level.field_geometry.viewpoint(u, v);
          const Eigen::Vector3d to = level.field_geometry.st_point(merged.geometry, s, t);
          double expected = 0.0;
          bool is_inside = true;
          for (const FieldLevelSlab& slab : level.slabs) {
            const double reach =
                (uv_y - slab.geometry.st_plane_y_mm) / (uv_y - merged.geometry.st_plane_y_mm);
            const Eigen::Vector3d hit = from + reach * (to - from);
            const double fine_s = slab.geometry.s.node_coordinate(hit.x());
            const double fine_t = slab.geometry.t.node_coordinate(hit.z());
            is_inside = is_inside && std::min(fine_s, fine_t) > 3.5 &&
                        std::max(fine_s, fine_t) < kNodes - 4.5;
            const double h = 0.01;
            const double curvature =
                (bump(fine_s + h, fine_t) + bump(fine_s - h, fine_t) + bump(fine_s, fine_t + h) +
                 bump(fine_s, fine_t - h) - 4.0 * bump(fine_s, fine_t)) /
                (h * h);
            expected += bump(fine_s, fine_t) + 0.5 * 0.75 * curvature;
          }
          if (!is_inside) continue;
          ++compared;
          // Nodes of both slabs are rounded (0.5 each, weights' magnitudes sum to at most 1.6 per
          // axis), and the sum again.
          ASSERT_NEAR(merged.at(u * 4 + v, s, t), expected, 2 * 0.5 * 1.6 * 1.6 + 0.5)
              << u << ' ' << v << ' ' << s << ' ' << t;
        }
  EXPECT_GT(compared, 16 * 40);
}

TEST(SlabMerging, HalvesTheNumberOfSlabsPerLevelAboveTheFirst) {
  const auto pyramid = make_field_pyramid(small_field(noise_of_node, 5, 4, 32), 4);
  EXPECT_EQ(pyramid[0]->slabs.size(), 5u);
  EXPECT_EQ(pyramid[1]->slabs.size(), 3u);
  EXPECT_EQ(pyramid[2]->slabs.size(), 2u);
  EXPECT_EQ(pyramid[3]->slabs.size(), 1u);
}

}  // namespace
}  // namespace af
