// SPDX-License-Identifier: Apache-2.0
#include "precompute/units/unit_planner.h"

#include <algorithm>
#include <vector>

#include <gtest/gtest.h>

#include "geometry/slab_sizing.h"

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

TEST(Planner, UnitsStayWithinTheirSizeDownToARunOfTiles) {
  const LightSlab light_slab = lattice(16, 16, {{NodeRange{0, 40}, NodeRange{0, 40}}});
  constexpr std::int64_t kSmallest = 2 * 2 * 2 * kRunOfT;
  for (const std::int64_t rays_per_unit : {kSmallest, 3 * kSmallest, 100 * kSmallest})
    for (const WorkUnit& unit : plan_units(light_slab, {rays_per_unit}))
      EXPECT_LE(static_cast<std::int64_t>(unit.sample_count()), rays_per_unit);
}

TEST(Planner, UnitsKeepAllOfUWhileTheyCanBeCutOtherwise) {
  const LightSlab light_slab = lattice(64, 64, {{NodeRange{0, 40}, NodeRange{0, 40}}});
  constexpr std::int64_t kLeastOfWholeRows = 64 * 2 * kRunOfT * kRunOfT;
  for (const std::int64_t rays_per_unit : {kLeastOfWholeRows, 3 * kLeastOfWholeRows})
    for (const WorkUnit& unit : plan_units(light_slab, {rays_per_unit}))
      EXPECT_EQ(unit.u.count, 64);
}

TEST(Planner, UnitsBeginAtRunsAndEndAtChunksOfTheFile) {
  LightSlab light_slab = lattice(16, 16, {{NodeRange{10, 500}, NodeRange{4, 300}}});
  for (const std::int64_t rays_per_unit : {std::int64_t{100000}, std::int64_t{1} << 22})
    for (const WorkUnit& unit : plan_units(light_slab, {rays_per_unit})) {
      EXPECT_EQ((unit.t.begin - 4) % kRunOfT, 0);
      EXPECT_EQ((unit.t.begin - 4) / kLargestT, (unit.t.end() - 5) / kLargestT);
      EXPECT_EQ((unit.s.begin - 10) / kLargestS, (unit.s.end() - 11) / kLargestS);
    }
}

TEST(Planner, RaysThroughTheBoxCostMoreThanRaysBesideIt) {
  const LightSlab light_slab = lattice(4, 4, {{NodeRange{0, 40}, NodeRange{0, 40}}});
  const auto units = plan_units(light_slab, {4 * 2 * 2 * kRunOfT});
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

TEST(Planner, EveryRankGetsUnitsUntilUnitsAreSmallest) {
  const LightSlab light_slab = lattice(16, 16, {{NodeRange{0, 40}, NodeRange{0, 40}}});
  for (const int ranks : {1, 3, 16})
    EXPECT_GE(plan_units(light_slab, plan_options_for_ranks(light_slab, ranks)).size(),
              static_cast<std::size_t>(16 * ranks));
}

}  // namespace
}  // namespace af
