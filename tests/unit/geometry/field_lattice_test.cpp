// SPDX-License-Identifier: Apache-2.0
#include "geometry/field_lattice.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "geometry/light_slab.h"

namespace af {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

/// 7 x 4 viewpoints, 20 x 12 nodes of which 6 x 4 are stored.
SlabLattice small_slab() {
  return {{7, {0, 7}}, {4, {0, 4}}, {20, {14, 6}}, {12, {2, 4}}};
}

TEST(FieldLattice, CountsTilesOfTheStoredPartAndNodesOfBoth) {
  const SlabLattice slab = small_slab();
  EXPECT_THAT(slab.tile_counts(), ElementsAre(4, 2, 3, 2));
  EXPECT_EQ(slab.tile_count(), 4 * 2 * 3 * 2);
  EXPECT_EQ(slab.stored_node_count(), 7 * 4 * 6 * 4);
  EXPECT_EQ(slab.node_count(), 7 * 4 * 20 * 12);
  SlabLattice wider = slab;
  wider.u = {9, {0, 9}};
  const FieldLattice field{{slab, wider, slab}};
  EXPECT_EQ(field.tiles_before(2), 48 + 60);
  EXPECT_EQ(field.tile_count(), 48 + 60 + 48);
  EXPECT_EQ(field.stored_node_count(), (7 + 9 + 7) * 4 * 6 * 4);
  EXPECT_EQ(field.node_count(), (7 + 9 + 7) * 4 * 20 * 12);
}

TEST(FieldLattice, NamesWhatIsNoLattice) {
  EXPECT_THAT(problems(small_slab(), "slab 3"), ElementsAre());
  const auto problem_with = [](const LatticeAxis& axis) {
    SlabLattice slab = small_slab();
    slab.s = axis;
    const auto found = problems(slab, "slab 3");
    return found.size() == 1 ? found.front() : std::to_string(found.size()) + " problems";
  };
  EXPECT_EQ(problem_with({1, {0, 1}}), "slab 3 s nodes = 1: must be between 2 and 65536");
  EXPECT_THAT(problem_with({65537, {0, 2}}), HasSubstr("nodes = 65537"));
  EXPECT_EQ(problem_with({20, {3, 4}}),
            "slab 3 s stored range [3, +4) is not an even-aligned part of 20 nodes");
  EXPECT_THAT(problem_with({20, {4, 3}}), HasSubstr("stored range [4, +3)"));
  EXPECT_THAT(problem_with({20, {-2, 4}}), HasSubstr("stored range [-2, +4)"));
  EXPECT_THAT(problem_with({20, {18, 4}}), HasSubstr("stored range [18, +4)"));
  EXPECT_THAT(problem_with({20, {2, 0}}), HasSubstr("stored range [2, +0)"));
  EXPECT_THAT(problem_with({20, {2, 2147483647}}), HasSubstr("stored range"));
  EXPECT_EQ(problem_with({21, {16, 5}}), "0 problems");
}

TEST(LightSlab, GivesItsLatticeSlabBySlab) {
  LightSlab light_slab;
  light_slab.u = {-1.0, 1.0, 7};
  light_slab.v = {-1.0, 1.0, 4};
  SlabGeometry slab;
  slab.s = {-1.0, 1.0, 20};
  slab.t = {-1.0, 1.0, 12};
  slab.stored_s = {14, 6};
  slab.stored_t = {2, 4};
  light_slab.slabs = {slab, slab};
  light_slab.slabs[1].stored_t = {0, 12};
  EXPECT_EQ(light_slab.lattice(0).tile_counts(), small_slab().tile_counts());
  EXPECT_EQ(light_slab.lattice(0).node_count(), small_slab().node_count());
  EXPECT_EQ(light_slab.lattice().slabs.size(), 2u);
  EXPECT_EQ(light_slab.lattice().tile_count(), 4 * 2 * 3 * 2 + 4 * 2 * 3 * 6);
}

TEST(LightSlab, NamesWhatIsNoGeometry) {
  LightSlab sound;
  sound.uv_plane_y_mm = 600.0;
  sound.u = sound.v = {-100.0, 100.0, 4};
  SlabGeometry slab;
  slab.s = slab.t = {-50.0, 50.0, 8};
  slab.stored_s = slab.stored_t = {0, 8};
  sound.slabs = {slab};
  EXPECT_THAT(problems(sound), ElementsAre());
  LightSlab bad = sound;
  bad.u.last_mm = -100.0;
  EXPECT_THAT(problems(bad), ElementsAre("u extent: must be finite and ascending"));
  bad = sound;
  bad.slabs[0].st_plane_y_mm = 600.0;
  EXPECT_THAT(problems(bad), ElementsAre("slab 0 st_plane_y_mm: must lie below the (u,v) plane"));
  bad = sound;
  bad.slabs[0].stored_s = {1, 4};
  EXPECT_THAT(problems(bad), ElementsAre(HasSubstr("slab 0 s stored range [1, +4)")));
  bad = sound;
  bad.slab_from_ct.linear() *= 2.0;
  EXPECT_EQ(problems(bad).size(), 1u);
}

}  // namespace
}  // namespace af
