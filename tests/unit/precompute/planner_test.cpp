// SPDX-License-Identifier: Apache-2.0
#include "precompute/planner.h"

#include <algorithm>
#include <vector>

#include <gtest/gtest.h>

namespace af {
namespace {

/// A geometry of given node counts; positions do not matter here.
LightSlab lattice(int u_nodes, int v_nodes, const std::vector<std::array<NodeRange, 2>>& stored) {
  LightSlab light_slab;
  light_slab.uv_plane_y_mm = 650.0;
  light_slab.u = {-10.0, 10.0, u_nodes};
  light_slab.v = {-10.0, 10.0, v_nodes};
  for (const auto& [stored_s, stored_t] : stored) {
    SlabGeometry slab;
    slab.s = {-10.0, 10.0, 40};
    slab.t = {-10.0, 10.0, 40};
    slab.stored_s = stored_s;
    slab.stored_t = stored_t;
    light_slab.slabs.push_back(slab);
  }
  return light_slab;
}

std::vector<LightSlab> lattices() {
  return {
      lattice(8, 8, {{NodeRange{0, 40}, NodeRange{0, 40}}}),
      lattice(7, 5, {{NodeRange{2, 11}, NodeRange{4, 9}}}),
      lattice(2, 3, {{NodeRange{0, 2}, NodeRange{38, 2}}}),
      lattice(5, 6, {{NodeRange{0, 12}, NodeRange{0, 7}}, {NodeRange{30, 10}, NodeRange{2, 3}}})};
}

constexpr std::array<std::int64_t, 5> kUnitSizes = {1, 30, 500, 20000, 262144};

TEST(Planner, UnitsCoverEveryTileExactlyOnce) {
  for (const LightSlab& light_slab : lattices())
    for (const std::int64_t rays_per_unit : kUnitSizes) {
      std::vector<int> visits(static_cast<std::size_t>(stored_tile_count(light_slab)), 0);
      const auto units = plan_units(light_slab, {rays_per_unit});
      for (std::size_t i = 0; i < units.size(); ++i) {
        EXPECT_EQ(units[i].id, i);
        const TileLattice numbering(light_slab, units[i].slab);
        for (std::size_t tile = 0; tile < units[i].tile_count(); ++tile)
          ++visits.at(static_cast<std::size_t>(numbering.global_index(units[i], light_slab, tile)));
      }
      EXPECT_EQ(std::count(visits.begin(), visits.end(), 1),
                static_cast<std::ptrdiff_t>(visits.size()))
          << "rays per unit " << rays_per_unit;
    }
}

TEST(Planner, UnitsBeginAtEvenNodesAndHoldAllStoredRays) {
  for (const LightSlab& light_slab : lattices())
    for (const std::int64_t rays_per_unit : kUnitSizes) {
      std::int64_t rays = 0;
      for (const WorkUnit& unit : plan_units(light_slab, {rays_per_unit})) {
        EXPECT_EQ(unit.u.begin % 2 + unit.v.begin % 2 + unit.s.begin % 2 + unit.t.begin % 2, 0);
        rays += static_cast<std::int64_t>(unit.sample_count());
      }
      EXPECT_EQ(rays, stored_ray_count(light_slab));
    }
}

TEST(Planner, UnitsStayWithinTheirSizeDownToOneRowOfTiles) {
  const LightSlab light_slab = lattice(16, 16, {{NodeRange{0, 40}, NodeRange{0, 40}}});
  constexpr std::int64_t kSmallest = 2 * 2 * 2 * 40;
  for (const std::int64_t rays_per_unit : {kSmallest, 3 * kSmallest, 100 * kSmallest})
    for (const WorkUnit& unit : plan_units(light_slab, {rays_per_unit}))
      EXPECT_LE(static_cast<std::int64_t>(unit.sample_count()), rays_per_unit);
}

TEST(Planner, EveryRankGetsUnitsUntilUnitsAreSmallest) {
  const LightSlab light_slab = lattice(16, 16, {{NodeRange{0, 40}, NodeRange{0, 40}}});
  for (const int ranks : {1, 3, 16})
    EXPECT_GE(plan_units(light_slab, plan_options_for_ranks(light_slab, ranks)).size(),
              static_cast<std::size_t>(16 * ranks));
}

}  // namespace
}  // namespace af
