// SPDX-License-Identifier: Apache-2.0
#include "precompute/codebook/mean_removal.h"

#include <algorithm>

#include <gtest/gtest.h>

#include "base/hash_random.h"
#include "precompute/codebook/unit_encoding.h"

namespace af {
namespace {

constexpr std::uint64_t kMeanTileSeed = 11;

Tile some_tile(std::uint64_t number, double level, double spread) {
  HashRandom random(kMeanTileSeed, number);
  Tile tile{};
  for (std::uint16_t& element : tile)
    element =
        static_cast<std::uint16_t>(std::clamp(level + spread * random.normal(), 0.0, 65535.0));
  return tile;
}

TEST(MeanRemoval, RoundsTheMeanAndLeavesTheRest) {
  for (const int step : {1, 48, 64, kMaxMeanStep})
    for (std::uint64_t i = 0; i < 200; ++i) {
      const Tile tile = some_tile(i, 200.0 * static_cast<double>(i), 400.0);
      const MeanRemovedTile removed = remove_mean(tile, step);
      EXPECT_EQ(removed.mean % step, 0);
      // 65535 need not be a multiple.
      EXPECT_LE(std::abs(16.0 * removed.mean - tile_sum(tile)),
                16.0 * (i < 190 ? 0.5 : 1.0) * step);
      const Tile shape = folded_shape(removed.shape);
      for (std::size_t k = 0; k < kTileElements; ++k)
        EXPECT_EQ(level_of(shape[k], removed.mean), tile[k]);
    }
}

TEST(MeanRemoval, FoldingKeepsDistancesAndOrdersBySlope) {
  const Tile a = some_tile(1, 32768.0, 300.0);
  const Tile b = some_tile(2, 32768.0, 300.0);
  EXPECT_EQ(folded_shape(folded_shape(a)), a);
  const auto distance = [](const Tile& x, const Tile& y) {
    std::int64_t sum = 0;
    for (std::size_t k = 0; k < kTileElements; ++k)
      sum += (std::int64_t{x[k]} - y[k]) * (std::int64_t{x[k]} - y[k]);
    return sum;
  };
  EXPECT_EQ(distance(folded_shape(a), folded_shape(b)), distance(a, b));
  const auto slope = [](const Tile& tile) {
    std::int64_t sum = 0;
    for (std::size_t k = 0; k < kTileElements; ++k)
      sum += (k & 2u) == 0 ? std::int64_t{tile[k]} : -std::int64_t{tile[k]};
    return sum;
  };
  EXPECT_EQ(std::int64_t{tile_sum(folded_shape(a))} - std::int64_t{tile_sum(folded_shape(b))},
            slope(a) - slope(b));
}

/// One unit of 1 x 1 x 2 x 3 tiles.
WorkUnit small_unit() {
  WorkUnit unit;
  unit.u = unit.v = {0, 2};
  unit.s = {0, 4};
  unit.t = {0, 6};
  return unit;
}

TEST(MeanRemoval, UnitsHoldRowsOfIndicesAndOfMeans) {
  UnitTiles tiles;
  tiles.occupied = {0b011011};  // tiles 2 and 5 are empty
  Tile faint{};
  faint[5] = 1;
  tiles.tiles = {
      some_tile(1, 5000.0, 100.0), some_tile(2, 70.0, 5.0), faint, some_tile(3, 65500.0, 50.0)};
  std::vector<Tile> shapes{Tile{}};
  for (const Tile& tile : tiles.tiles)
    if (!(tile == faint)) shapes.push_back(remove_mean(tile, 64).shape);
  std::sort(shapes.begin(), shapes.end(), codeword_less);
  const Codebook codebook = codebook_of_searched(shapes, 64);
  ASSERT_TRUE(problems(codebook).empty()) << problems(codebook).front();
  EXPECT_EQ(codebook.mean_step, 64);
  EXPECT_EQ(searched_codewords(codebook), shapes);
  const EncodedUnit encoded = encode_unit(NearestCodeword(codebook), small_unit(), tiles);
  ASSERT_EQ(encoded.indices.size(), 12u);
  EXPECT_EQ(encoded.squared_error, 1u) << "of the faint tile";
  const auto decoded = [&](std::size_t s, std::size_t t) {
    Tile tile{};
    for (std::size_t k = 0; k < kTileElements; ++k)
      tile[k] = level_of(codebook.codewords[encoded.indices[6 * s + t]][k],
                         encoded.indices[6 * s + 3 + t]);
    return tile;
  };
  EXPECT_EQ(decoded(0, 0), tiles.tiles[0]);
  EXPECT_EQ(decoded(0, 1), tiles.tiles[1]);
  EXPECT_EQ(decoded(1, 0), Tile{}) << "nearer to nothing than to any shape";
  EXPECT_EQ(decoded(1, 1), tiles.tiles[3]);
  EXPECT_EQ(decoded(0, 2), Tile{});
  EXPECT_EQ(decoded(1, 2), Tile{});
}

TEST(MeanRemoval, LeavesPlainCodebooksAlone) {
  const Codebook codebook{{Tile{}, some_tile(1, 500.0, 100.0)}};
  EXPECT_EQ(searched_codewords(codebook), codebook.codewords);
  EXPECT_EQ(codebook_of_searched(codebook.codewords, 0).codewords, codebook.codewords);
}

}  // namespace
}  // namespace af
