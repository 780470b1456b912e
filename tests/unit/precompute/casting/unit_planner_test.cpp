// SPDX-License-Identifier: Apache-2.0
#include "precompute/casting/unit_planner.h"

#include <algorithm>
#include <vector>

#include <gtest/gtest.h>

namespace af {
namespace {

LatticeAxis whole_axis(int nodes) {
  return {nodes, {0, nodes}};
}

SlabLattice slab_of(int u_nodes,
                    int v_nodes,
                    const NodeRange& stored_s,
                    const NodeRange& stored_t) {
  return {whole_axis(u_nodes), whole_axis(v_nodes), {40, stored_s}, {40, stored_t}};
}

std::vector<FieldLattice> lattices() {
  return {{{slab_of(8, 8, {0, 40}, {0, 40})}},
          {{slab_of(7, 5, {2, 11}, {4, 9})}},
          {{slab_of(2, 3, {0, 2}, {38, 2})}},
          {{slab_of(5, 6, {0, 12}, {0, 7}), slab_of(5, 6, {30, 10}, {2, 3})}},
          {{slab_of(5, 6, {0, 12}, {0, 7}), slab_of(8, 3, {30, 10}, {2, 3})}}};
}

constexpr std::array<std::int64_t, 5> kUnitSizes = {1, 30, 500, 20000, 262144};

TEST(Planner, UnitsCoverEveryTileExactlyOnce) {
  for (const FieldLattice& lattice : lattices())
    for (const std::int64_t rays_per_unit : kUnitSizes) {
      std::vector<int> visits(static_cast<std::size_t>(lattice.tile_count()), 0);
      const auto units = plan_units(lattice, {rays_per_unit});
      for (std::size_t i = 0; i < units.size(); ++i) {
        EXPECT_EQ(units[i].id, i);
        const TilePlaces places(lattice, units[i]);
        for (std::size_t tile = 0; tile < units[i].tile_count(); ++tile)
          ++visits.at(static_cast<std::size_t>(places.global_index(tile)));
      }
      EXPECT_EQ(std::count(visits.begin(), visits.end(), 1),
                static_cast<std::ptrdiff_t>(visits.size()))
          << "rays per unit " << rays_per_unit;
    }
}

TEST(Planner, UnitsBeginAtEvenNodesAndHoldAllStoredRays) {
  for (const FieldLattice& lattice : lattices())
    for (const std::int64_t rays_per_unit : kUnitSizes) {
      std::int64_t rays = 0;
      for (const WorkUnit& unit : plan_units(lattice, {rays_per_unit})) {
        EXPECT_EQ(unit.u.begin % 2 + unit.v.begin % 2 + unit.s.begin % 2 + unit.t.begin % 2, 0);
        rays += static_cast<std::int64_t>(unit.sample_count());
      }
      EXPECT_EQ(rays, lattice.stored_node_count());
    }
}

TEST(Planner, UnitsStayWithinTheirSizeDownToARunOfTiles) {
  const FieldLattice lattice{{slab_of(16, 16, {0, 40}, {0, 40})}};
  constexpr std::int64_t kSmallest = 2 * 2 * 2 * kRunOfT;
  for (const std::int64_t rays_per_unit : {kSmallest, 3 * kSmallest, 100 * kSmallest})
    for (const WorkUnit& unit : plan_units(lattice, {rays_per_unit}))
      EXPECT_LE(static_cast<std::int64_t>(unit.sample_count()), rays_per_unit);
}

TEST(Planner, UnitsKeepAllOfUWhileTheyCanBeCutOtherwise) {
  const FieldLattice lattice{{slab_of(64, 64, {0, 40}, {0, 40})}};
  constexpr std::int64_t kLeastOfWholeRows = 64 * 2 * kRunOfT * kRunOfT;
  for (const std::int64_t rays_per_unit : {kLeastOfWholeRows, 3 * kLeastOfWholeRows})
    for (const WorkUnit& unit : plan_units(lattice, {rays_per_unit})) EXPECT_EQ(unit.u.count, 64);
}

TEST(Planner, UnitsBeginAtRunsAndEndAtChunksOfTheFile) {
  const FieldLattice lattice{{slab_of(16, 16, {10, 500}, {4, 300})}};
  for (const std::int64_t rays_per_unit : {std::int64_t{100000}, std::int64_t{1} << 22})
    for (const WorkUnit& unit : plan_units(lattice, {rays_per_unit})) {
      EXPECT_EQ((unit.t.begin - 4) % kRunOfT, 0);
      EXPECT_EQ((unit.t.begin - 4) / kLargestT, (unit.t.end() - 5) / kLargestT);
      EXPECT_EQ((unit.s.begin - 10) / kLargestS, (unit.s.end() - 11) / kLargestS);
    }
}

TEST(Planner, EveryRankGetsUnitsUntilUnitsAreSmallest) {
  const FieldLattice lattice{{slab_of(16, 16, {0, 40}, {0, 40})}};
  for (const int ranks : {1, 3, 16})
    EXPECT_GE(plan_units(lattice, plan_options_for_ranks(lattice, ranks)).size(),
              static_cast<std::size_t>(16 * ranks));
}

}  // namespace
}  // namespace af
