// SPDX-License-Identifier: Apache-2.0
#include "precompute/codebook/nearest_codeword.h"

#include <algorithm>
#include <limits>

#include <gtest/gtest.h>

#include "base/error.h"
#include "base/hash_random.h"
#include "base/vector_width.h"
#include "precompute/codebook/mean_removal.h"

namespace af {
namespace {

constexpr int kMeanStep = 64;  ///< above 0: the search for folded shapes
constexpr std::uint64_t kTileSeed = 7;

/// Tiles like a field's: a level, a slope along each axis, and noise; some faint, some flat.
std::vector<Tile> field_like_tiles(std::size_t count, std::uint64_t stream, double level_scale) {
  std::vector<Tile> tiles(count);
  for (std::size_t i = 0; i < count; ++i) {
    HashRandom random(kTileSeed, stream, i);
    const double level = level_scale * random.uniform() * random.uniform();
    std::array<double, 4> slope{};
    for (double& of_axis : slope) of_axis = 0.05 * level * random.normal();
    for (unsigned element = 0; element < 16; ++element) {
      double value = level + 0.005 * level * random.normal();
      for (unsigned axis = 0; axis < 4; ++axis)
        value += ((element >> (3u - axis)) & 1u) != 0 ? slope[axis] : 0.0;
      tiles[i][element] = static_cast<std::uint16_t>(std::clamp(value, 0.0, 65535.0));
    }
  }
  return tiles;
}

Codebook codebook_of(std::vector<Tile> codewords) {
  codewords.push_back(Tile{});
  std::sort(codewords.begin(), codewords.end(), codeword_less);
  return {std::move(codewords)};
}

struct Answer {
  std::uint32_t index = 0;
  std::uint64_t squared_error = std::numeric_limits<std::uint64_t>::max();
};

Answer brute_force(const Codebook& codebook, const Tile& tile) {
  Answer best;
  for (std::uint32_t i = 0; i < codebook.size(); ++i) {
    std::uint64_t error = 0;
    for (std::size_t element = 0; element < 16; ++element) {
      const std::int64_t difference =
          std::int64_t{tile[element]} - std::int64_t{codebook.codewords[i][element]};
      error += static_cast<std::uint64_t>(difference * difference);
    }
    if (error < best.squared_error) best = {i, error};
  }
  return best;
}

void expect_equals_brute_force(const NearestCodeword& search,
                               const Codebook& codebook,
                               const std::vector<Tile>& tiles) {
  for (const VectorWidth width : supported_vector_widths()) {
    force_vector_width(width);
    std::vector<std::uint32_t> nearest(tiles.size());
    std::vector<std::uint64_t> errors(tiles.size());
    search.search(tiles, SearchHint::None, nearest, errors);
    std::vector<std::uint32_t> from_bad_hints(tiles.size());
    for (std::size_t i = 0; i < tiles.size(); ++i)
      from_bad_hints[i] = static_cast<std::uint32_t>(hash64(kTileSeed, i) % codebook.size());
    std::vector<std::uint64_t> errors_from_bad_hints(tiles.size());
    search.search(tiles, SearchHint::PerTile, from_bad_hints, errors_from_bad_hints);
    for (std::size_t i = 0; i < tiles.size(); ++i) {
      const Answer expected = brute_force(codebook, tiles[i]);
      ASSERT_EQ(nearest[i], expected.index) << "tile " << i << ", width " << to_string(width);
      ASSERT_EQ(errors[i], expected.squared_error);
      ASSERT_EQ(from_bad_hints[i], expected.index);
      ASSERT_EQ(errors_from_bad_hints[i], expected.squared_error);
    }
  }
  force_vector_width(std::nullopt);
}

void expect_equals_brute_force(const Codebook& codebook, const std::vector<Tile>& tiles) {
  expect_equals_brute_force(NearestCodeword(codebook), codebook, tiles);
  const Codebook of_shapes = codebook_of_searched(codebook.codewords, kMeanStep);
  expect_equals_brute_force(NearestCodeword(of_shapes), codebook, tiles);
}

TEST(NearestCodeword, EqualsBruteForceOnEveryWidth) {
  for (const std::size_t codewords : {1u, 2u, 15u, 16u, 17u, 1000u})
    expect_equals_brute_force(codebook_of(field_like_tiles(codewords - 1, 1, 20000.0)),
                              field_like_tiles(1500, 2, 20000.0));
}

TEST(NearestCodeword, OfFoldedShapesEqualsBruteForce) {
  const auto folded_shapes = [](std::size_t count, std::uint64_t stream) {
    std::vector<Tile> tiles = field_like_tiles(count, stream, 20000.0);
    for (Tile& tile : tiles) tile = remove_mean(tile, kMeanStep).shape;
    return tiles;
  };
  expect_equals_brute_force(codebook_of(folded_shapes(5000, 1)), folded_shapes(1500, 2));
}

TEST(NearestCodeword, EqualsBruteForceAtTheExtremesOfTheRange) {
  std::vector<Tile> corners;
  for (std::uint64_t i = 0; i < 300; ++i) {
    const std::uint64_t bits = hash64(kTileSeed, i);
    Tile tile{};
    for (unsigned element = 0; element < 16; ++element)
      tile[element] = ((bits >> element) & 1u) != 0 ? std::uint16_t{65535}
                                                    : static_cast<std::uint16_t>((bits >> 32u) % 3);
    corners.push_back(tile);
  }
  corners.push_back(Tile{});
  std::vector<Tile> codewords(corners.begin(), corners.begin() + 150);
  Tile all_full{};
  all_full.fill(65535);
  codewords.push_back(all_full);
  corners.push_back(all_full);
  expect_equals_brute_force(codebook_of(codewords), corners);
}

TEST(NearestCodeword, TiesTakeTheLowestIndex) {
  // Levels 0 ... 2 only: a great many codewords are equally far, some are equal.
  const auto coarse = [](std::size_t count, std::uint64_t stream) {
    std::vector<Tile> tiles(count);
    for (std::size_t i = 0; i < count; ++i)
      for (unsigned element = 0; element < 16; ++element)
        tiles[i][element] = static_cast<std::uint16_t>(hash64(kTileSeed, stream, i, element) % 3);
    return tiles;
  };
  std::vector<Tile> codewords = coarse(200, 3);
  codewords.insert(codewords.end(), codewords.begin(), codewords.begin() + 100);
  expect_equals_brute_force(codebook_of(codewords), coarse(1000, 4));
}

TEST(NearestCodeword, TiesFartherThanFloatsAreExactTakeTheLowestIndex) {
  // Distances from 9000^2 up (a sum of 16 * 9000^2 > 2^24 in the transform): the codewords are one
  // level from the tile's mirror images, so floats cannot tell ties from neighbours.
  std::vector<Tile> codewords;
  for (unsigned i = 0; i < 200; ++i) {
    Tile tile;
    tile.fill(30000);
    tile[i % 16] = static_cast<std::uint16_t>(i % 2 == 0 ? 39000 : 21000);
    tile[(i / 16 + 5) % 16] = static_cast<std::uint16_t>(30000 + i % 3);
    codewords.push_back(tile);
  }
  std::vector<Tile> tiles(20);
  for (unsigned i = 0; i < tiles.size(); ++i) {
    tiles[i].fill(30000);
    tiles[i][i % 16] = static_cast<std::uint16_t>(30000 + i / 8);
  }
  expect_equals_brute_force(codebook_of(codewords), tiles);
}

TEST(NearestCodeword, RefusesAnUnsortedCodebook) {
  Codebook codebook = codebook_of(field_like_tiles(20, 1, 20000.0));
  std::swap(codebook.codewords[3], codebook.codewords[15]);
  EXPECT_THROW(NearestCodeword{codebook}, InputError);
}

}  // namespace
}  // namespace af
