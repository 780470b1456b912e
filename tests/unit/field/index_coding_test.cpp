// SPDX-License-Identifier: Apache-2.0
#include "field/index_coding.h"

#include <algorithm>
#include <bit>

#include <gtest/gtest.h>

#include "base/crc32c.h"
#include "base/error.h"
#include "base/hash_random.h"
#include "base/vector_width.h"

namespace af {
namespace {

constexpr std::uint64_t kSeed = 3;
using Extents = std::array<std::size_t, 4>;

std::size_t count_of(const Extents& tiles) {
  return tiles[0] * tiles[1] * tiles[2] * tiles[3];
}

/// Some codewords twice, some of the largest levels.
Codebook some_codebook(std::size_t codewords) {
  Codebook codebook{{Tile{}}};
  for (std::size_t i = 1; i < codewords; ++i) {
    HashRandom random(kSeed, i % 97, codewords);
    const double level = i % 11 == 0 ? 65535.0 : 40000.0 * random.uniform();
    Tile tile{};
    for (std::uint16_t& element : tile)
      element = static_cast<std::uint16_t>(std::min(level + 300.0 * random.uniform(), 65535.0));
    codebook.codewords.push_back(tile);
  }
  std::sort(codebook.codewords.begin(), codebook.codewords.end(), codeword_less);
  return codebook;
}

/// Every third tile is empty; the codewords change slowly along t.
std::vector<std::uint16_t> some_indices(const Extents& tiles, std::size_t codewords) {
  std::vector<std::uint16_t> indices(count_of(tiles));
  for (std::size_t i = 0; i < indices.size(); ++i)
    if (hash64(kSeed, i / 7) % 3 != 0)
      indices[i] = static_cast<std::uint16_t>((i / 5 + hash64(kSeed, i) % 9) % codewords);
  return indices;
}

TEST(IndexCoding, GivesIndicesBackAndTheSameBytesOnEveryWidth) {
  for (const std::size_t codewords : {1u, 2u, 3u, 50u, 4096u, 65536u}) {
    const IndexCoding coding(some_codebook(codewords));
    for (const Extents& tiles :
         {Extents{1, 1, 1, 1}, Extents{3, 2, 9, 11}, Extents{1, 2, 3, 64}, Extents{8, 1, 20, 5}}) {
      const auto indices = some_indices(tiles, codewords);
      std::vector<std::uint8_t> first;
      for (const VectorWidth width : supported_vector_widths()) {
        force_vector_width(width);
        const auto bytes = coding.encode(indices, tiles);
        if (first.empty()) first = bytes;
        EXPECT_EQ(bytes, first) << to_string(width);
        std::vector<std::uint16_t> back(indices.size(), 1);
        EXPECT_TRUE(coding.decode(bytes, tiles, back)) << to_string(width);
        EXPECT_EQ(back, indices) << codewords << " " << to_string(width);
      }
      force_vector_width({});
    }
  }
}

constexpr int kMeanStep = 48;

/// Shapes of differences of a few hundred levels.
Codebook some_shapes(std::size_t codewords) {
  Codebook codebook{{Tile{}}, kMeanStep};
  for (std::size_t i = 1; i < codewords; ++i) {
    HashRandom random(kSeed, i, codewords);
    Tile tile{};
    for (std::uint16_t& element : tile)
      element = static_cast<std::uint16_t>(kShapeZero + 900.0 * random.uniform(-1, 1));
    codebook.codewords.push_back(tile);
  }
  std::sort(
      codebook.codewords.begin() + 1, codebook.codewords.end(), [](const Tile& a, const Tile& b) {
        return codeword_less(folded_shape(a), folded_shape(b));
      });
  return codebook;
}

/// The indices of some_indices(), and means that change slowly but for some leaps to the limits.
std::vector<std::uint16_t> some_indices_and_means(const Extents& tiles, std::size_t codewords) {
  const std::vector<std::uint16_t> indices = some_indices(tiles, codewords);
  const std::size_t row = tiles[3];
  std::vector<std::uint16_t> values(2 * indices.size());
  for (std::size_t i = 0; i < indices.size(); ++i) {
    const std::size_t at = i / row * 2 * row + i % row;
    values[at] = indices[i];
    const std::uint64_t noise = hash64(kSeed + 1, i);
    std::uint64_t mean = 20000 + 40 * (i % 300) + noise % 500;
    if (noise % 31 == 0) mean = noise % 2 == 0 ? 0 : 65535;
    if (indices[i] != 0)
      values[at + row] = static_cast<std::uint16_t>(mean / kMeanStep * kMeanStep);
  }
  return values;
}

TEST(IndexCoding, GivesMeansBackAndTheSameBytesOnEveryWidth) {
  for (const std::size_t codewords : {1u, 2u, 50u, 4096u}) {
    const IndexCoding coding(some_shapes(codewords));
    EXPECT_EQ(coding.values_per_tile(), 2u);
    for (const Extents& tiles :
         {Extents{1, 1, 1, 1}, Extents{3, 2, 9, 11}, Extents{1, 2, 3, 64}, Extents{8, 1, 20, 5}}) {
      const auto values = some_indices_and_means(tiles, codewords);
      std::vector<std::uint8_t> first;
      for (const VectorWidth width : supported_vector_widths()) {
        force_vector_width(width);
        const auto bytes = coding.encode(values, tiles);
        EXPECT_LE(bytes.size(), IndexCoding::most_bytes(count_of(tiles)));
        if (first.empty()) first = bytes;
        EXPECT_EQ(bytes, first) << to_string(width);
        std::vector<std::uint16_t> back(values.size(), 1);
        EXPECT_TRUE(coding.decode(bytes, tiles, back)) << to_string(width);
        EXPECT_EQ(back, values) << codewords << " " << to_string(width);
      }
      force_vector_width({});
    }
  }
}

TEST(IndexCoding, TellsSmoothMeansInFewBits) {
  // Planes of levels: what a prediction leaves is the rounding to steps.
  const Extents tiles = {8, 1, 64, 64};
  Codebook codebook = some_shapes(2);
  for (std::size_t i = 0; i < kTileElements; ++i)
    codebook.codewords[1][i] = static_cast<std::uint16_t>(kShapeZero + ((i & 1u) != 0 ? 6 : -6) +
                                                          ((i & 2u) != 0 ? 10 : -10));
  std::vector<std::uint16_t> values(2 * count_of(tiles), 1);
  for (std::size_t i = 0; i < count_of(tiles); ++i) {
    const std::size_t s = i / 64 % 64;
    const std::size_t t = i % 64;
    values[i / 64 * 128 + 64 + t] =
        static_cast<std::uint16_t>((20000 + 24 * t + 40 * s) / kMeanStep * kMeanStep);
  }
  const auto bytes = IndexCoding(codebook).encode(values, tiles);
  constexpr double kMostBits = 1.5;
  EXPECT_LT(8.0 * static_cast<double>(bytes.size()),
            kMostBits * static_cast<double>(count_of(tiles)));
}

TEST(IndexCoding, RefusesMeansThatAreNone) {
  const IndexCoding coding(some_shapes(50));
  const Extents tiles = {1, 1, 1, 2};
  const auto refuses = [&](std::vector<std::uint16_t> values) {
    EXPECT_THROW((void)coding.encode(values, tiles), std::logic_error);
  };
  (void)coding.encode(std::vector<std::uint16_t>{1, 0, 96, 0}, tiles);
  refuses({1, 0, 97, 0});
  refuses({1, 0, 96, 48});
  refuses({50, 0, 96, 0});
  refuses({1, 0});
}

/// What noise decodes to is within the limits, too.
TEST(IndexCoding, DecodesNoMeansBeyondTheLevels) {
  const Extents tiles = {4, 1, 20, 12};
  constexpr std::size_t kCodewords = 50;
  const Codebook codebook = some_shapes(kCodewords);
  const IndexCoding coding(codebook);
  const auto bytes = coding.encode(some_indices_and_means(tiles, kCodewords), tiles);
  std::vector<std::uint16_t> back(2 * count_of(tiles));
  for (std::size_t size = 0; size < bytes.size(); ++size)
    EXPECT_FALSE(coding.decode(std::span(bytes).first(size), tiles, back)) << size;
  for (std::uint64_t i = 0; i < 50; ++i) {
    std::vector<std::uint8_t> noise(1000);
    for (std::size_t k = 0; k < noise.size(); ++k)
      noise[k] = static_cast<std::uint8_t>(hash64(kSeed, i, k));
    EXPECT_FALSE(coding.decode(noise, tiles, back));
    for (std::size_t row = 0; row < 2 * count_of(tiles); row += 24)
      for (std::size_t t = 0; t < 12; ++t) {
        EXPECT_LT(back[row + t], kCodewords);
        EXPECT_EQ(back[row + 12 + t] % kMeanStep, 0);
      }
  }
}

TEST(IndexCoding, DecodesBlocksTogetherAsOneByOne) {
  const Extents tiles = {3, 2, 9, 11};
  const IndexCoding coding(some_codebook(3000));
  // More than are decoded in turns, of which some end early: all tiles but a few are empty.
  std::vector<std::vector<std::uint16_t>> given(11, some_indices(tiles, 3000));
  for (std::size_t k = 0; k < given.size(); ++k)
    for (std::size_t i = 0; i < given[k].size(); ++i)
      if (hash64(kSeed, i) % given.size() < k) given[k][i] = 0;
  std::vector<std::vector<std::uint8_t>> bytes;
  for (const auto& indices : given) bytes.push_back(coding.encode(indices, tiles));
  for (const VectorWidth width : supported_vector_widths()) {
    force_vector_width(width);
    auto back = given;
    std::vector<CodedBlock> blocks;
    for (std::size_t k = 0; k < given.size(); ++k) {
      std::ranges::fill(back[k], std::uint16_t{1});
      blocks.push_back({bytes[k], back[k]});
    }
    EXPECT_TRUE(coding.decode(blocks, tiles)) << to_string(width);
    EXPECT_EQ(back, given) << to_string(width);
    EXPECT_TRUE(coding.decode(std::span<const CodedBlock>(), tiles));
    blocks[6].bytes = blocks[6].bytes.first(bytes[6].size() - 1);
    EXPECT_FALSE(coding.decode(blocks, tiles)) << to_string(width);
    back[6] = given[6];
    EXPECT_EQ(back, given) << "a damaged block spoils no other one";
  }
  force_vector_width({});
}

/// Files are read by later versions: when this fails, the filter needs a new version number, and
/// the old coding has to stay.
TEST(IndexCoding, KeepsItsFormat) {
  const Extents tiles = {8, 1, 20, 12};
  const auto bytes = IndexCoding(some_codebook(4096)).encode(some_indices(tiles, 4096), tiles);
  EXPECT_EQ(crc32c(std::as_bytes(std::span(bytes))), 2924898820u) << bytes.size();
  const auto with_means =
      IndexCoding(some_shapes(4096)).encode(some_indices_and_means(tiles, 4096), tiles);
  EXPECT_EQ(crc32c(std::as_bytes(std::span(with_means))), 3601487233u) << with_means.size();
}

TEST(IndexCoding, RefusesBytesThatNoEncoderWrites) {
  const Extents tiles = {4, 1, 20, 12};
  constexpr std::size_t kCodewords = 50;
  const IndexCoding coding(some_codebook(kCodewords));
  const auto bytes = coding.encode(some_indices(tiles, kCodewords), tiles);
  std::vector<std::uint16_t> back(count_of(tiles));
  for (std::size_t size = 0; size < bytes.size(); ++size)
    EXPECT_FALSE(coding.decode(std::span(bytes).first(size), tiles, back)) << size;
  auto longer = bytes;
  longer.push_back(0);
  EXPECT_FALSE(coding.decode(longer, tiles, back));
  // Noise decodes to something, which at least stays within the codebook.
  for (std::uint64_t i = 0; i < 50; ++i) {
    std::vector<std::uint8_t> noise(400);
    for (std::size_t k = 0; k < noise.size(); ++k)
      noise[k] = static_cast<std::uint8_t>(hash64(kSeed, i, k));
    EXPECT_FALSE(coding.decode(noise, tiles, back));
    EXPECT_LT(*std::max_element(back.begin(), back.end()), kCodewords);
  }
}

TEST(IndexCoding, RefusesIndicesBeyondTheCodebook) {
  const IndexCoding coding(some_codebook(50));
  const std::vector<std::uint16_t> indices = {3, 50};
  EXPECT_THROW((void)coding.encode(indices, {1, 1, 1, 2}), std::logic_error);
  EXPECT_THROW((void)coding.encode(std::span(indices).first(1), {1, 1, 1, 2}), std::logic_error);
  EXPECT_THROW((void)coding.encode(std::span(indices).first(0), {1, 1, 0, 2}), std::logic_error);
}

/// Readers refuse extents that a file is too small for before they ask for memory.
TEST(IndexCoding, ShrinksNothingByMoreThanDeflateCan) {
  constexpr std::size_t kMostRatio = 1032;
  const Extents tiles = {8, 4, 128, 64};
  const std::vector<std::uint16_t> empty(count_of(tiles), 0);
  const auto bytes = IndexCoding(some_codebook(50)).encode(empty, tiles);
  EXPECT_GE(bytes.size() * kMostRatio, 2 * empty.size());
}

TEST(CodewordTree, LeadsToEveryCodewordAndSplitsAtItsThresholds) {
  const Codebook codebook = some_codebook(1000);
  const CodewordTree tree(codebook);
  const CodewordTables tables = tree.tables();
  for (std::uint16_t i = 1; i < 1000; ++i) {
    const std::uint32_t leaf = tables.leaves[i];
    ASSERT_EQ(tables.codewords_at[leaf], i);
    std::uint32_t cluster = 0;
    std::uint32_t within = tables.first_node;
    for (int left = static_cast<int>(std::bit_width(leaf)) - 2; left >= 0; --left) {
      const std::uint32_t number = leaf >> static_cast<unsigned>(left);
      const std::uint32_t turn = number & 1u;
      ASSERT_EQ(tables.codewords_at[number / 2], 0);
      const auto coefficient =
          static_cast<std::size_t>(tables.clusters[cluster].splits[within] % kNodesOfCluster);
      const float threshold = tables.clusters[cluster].thresholds[within];
      const float value = tables.coefficients[i * kTileElements + coefficient];
      if (turn == 0)
        EXPECT_LE(value, threshold);
      else
        EXPECT_GE(value, threshold);
      within = 2 * within + turn;
      if (within < kNodesOfCluster) continue;
      cluster = kNodesOfCluster * cluster + 1 + within - kNodesOfCluster;
      within = 1;
    }
  }
}

TEST(HadamardCoefficients, AreSumsAndDifferencesOfHalves) {
  Tile tile{};
  tile[tile_element(1, 0, 1, 0)] = 5;
  const TileCoefficients coefficients = hadamard_coefficients(tile);
  EXPECT_EQ(coefficients[0], 5.0f);
  EXPECT_EQ(coefficients[tile_element(1, 0, 0, 0)], -5.0f);
  EXPECT_EQ(coefficients[tile_element(0, 1, 0, 0)], 5.0f);
  EXPECT_EQ(coefficients[tile_element(1, 0, 1, 0)], 5.0f);
}

}  // namespace
}  // namespace af
