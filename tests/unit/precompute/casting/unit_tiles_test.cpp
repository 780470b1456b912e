// SPDX-License-Identifier: Apache-2.0
#include "precompute/casting/unit_tiles.h"

#include <gtest/gtest.h>

namespace af {
namespace {

WorkUnit odd_unit() {
  WorkUnit unit;
  unit.u = {0, 3};
  unit.v = {4, 2};
  unit.s = {2, 5};
  unit.t = {6, 7};
  return unit;
}

/// A sample that tells its node: 1000 u + 100 v + 10 s + t + 1, local to the unit.
std::vector<std::uint16_t> telling_samples(const WorkUnit& unit) {
  std::vector<std::uint16_t> samples;
  for (int u = 0; u < unit.u.count; ++u)
    for (int v = 0; v < unit.v.count; ++v)
      for (int s = 0; s < unit.s.count; ++s)
        for (int t = 0; t < unit.t.count; ++t)
          samples.push_back(static_cast<std::uint16_t>(1000 * u + 100 * v + 10 * s + t + 1));
  return samples;
}

TEST(UnitTiles, OddEndsRepeatTheLastNode) {
  const WorkUnit unit = odd_unit();
  const UnitTiles tiles = make_unit_tiles(unit, telling_samples(unit));
  ASSERT_EQ(tiles.tiles.size(), unit.tile_count());
  std::size_t next = 0;
  for (int a = 0; a < 2; ++a)
    for (int c = 0; c < 3; ++c)
      for (int d = 0; d < 4; ++d) {
        const Tile& tile = tiles.tiles[next++];
        for (unsigned i = 0; i < 16; ++i) {
          const int u = std::min(2 * a + static_cast<int>(i >> 3u), 2);
          const int v = static_cast<int>((i >> 2u) & 1u);
          const int s = std::min(2 * c + static_cast<int>((i >> 1u) & 1u), 4);
          const int t = std::min(2 * d + static_cast<int>(i & 1u), 6);
          EXPECT_EQ(tile[i], 1000 * u + 100 * v + 10 * s + t + 1);
        }
      }
}

TEST(UnitTiles, EmptyTilesAreDroppedAndTheRestKeepTheirPlaces) {
  const WorkUnit unit = odd_unit();
  std::vector<std::uint16_t> samples(unit.sample_count(), 0);
  samples[unit.sample_count() - 1] = 7;  // u 2, v 1, s 4, t 6: the last tile
  const UnitTiles tiles = make_unit_tiles(unit, samples);
  ASSERT_EQ(tiles.tiles.size(), 1u);
  tiles.for_each([&](std::size_t local_tile, const Tile& tile) {
    EXPECT_EQ(local_tile, unit.tile_count() - 1);
    EXPECT_EQ(tile[tile_element(1, 1, 1, 1)], 7);  // the replicated corner
    EXPECT_EQ(tile[tile_element(1, 0, 1, 1)], 0);
  });
  EXPECT_TRUE(problems(tiles, unit).empty());
}

TEST(UnitTiles, InconsistentBitmapsAreNamed) {
  const WorkUnit unit = odd_unit();
  const UnitTiles sound = make_unit_tiles(unit, telling_samples(unit));
  UnitTiles one_missing = sound;
  one_missing.tiles.pop_back();
  EXPECT_EQ(problems(one_missing, unit).size(), 1u);
  UnitTiles beyond = sound;
  beyond.occupied.back() |= std::uint64_t{1} << 63u;
  EXPECT_FALSE(problems(beyond, unit).empty());
  UnitTiles short_bitmap = sound;
  short_bitmap.occupied.clear();
  EXPECT_EQ(problems(short_bitmap, unit).size(), 1u);
}

}  // namespace
}  // namespace af
