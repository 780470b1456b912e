// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "field/tile.h"
#include "field/tile_filter.h"

namespace af {

inline constexpr std::size_t kMaxCodewords = 65536;  ///< an index is 16 bits

/// Codewords of the vector quantiser. Codeword 0 is the zero tile.
///
/// With plain tiles, a codeword is a tile. Codewords are sorted by the sum of their elements (ties:
/// lexicographically), so that a search can bound distances by the sum alone.
///
/// With mean-removed tiles (mean-removed VQ: Baker and Gray 1983), a codeword is a tile's shape,
/// the differences from its mean. The field holds the mean beside the index, as a multiple of
/// `mean_step` levels. Shapes are stored with kShapeZero added to every element. From codeword 1 on
/// they are sorted like plain tiles, but folded (folded_shape()), because their unfolded sums
/// hardly differ. Codeword 0 goes with mean 0 and marks an empty tile.
///
/// Tiles are stored [u][v][s][t] as indices; with means, each row along t is followed by a row of
/// as many means: [u][v][s][2][t].
struct Codebook {
  std::vector<Tile> codewords;
  int mean_step = 0;  ///< 0 for plain tiles
  /// Corrects decoded tiles; without it they are taken as they are.
  std::optional<TileFilter> filter = {};

  [[nodiscard]] std::size_t size() const { return codewords.size(); }
  [[nodiscard]] bool has_means() const { return mean_step > 0; }
  /// How many numbers are stored for a tile: its index and, where tiles have means, its mean.
  [[nodiscard]] std::size_t values_per_tile() const { return has_means() ? 2 : 1; }
};

/// The stored value of a shape's element that equals the mean.
inline constexpr int kShapeZero = 32768;
/// The largest step. Means in larger steps would be of no use.
inline constexpr int kMaxMeanStep = 4096;

/// The level that an element of a mean-removed tile stands for, limited to 0 ... 65535.
inline std::uint16_t level_of(std::uint16_t element, std::uint16_t mean) {
  return static_cast<std::uint16_t>(std::clamp(int{mean} + int{element} - kShapeZero, 0, 65535));
}

/// Exact Hadamard coefficients of a tile as decoded, before levels are limited to 0 ... 65535.
/// `mean` adds kTileElements times itself to coefficient 0. It is 0 where tiles have no means, and
/// for codeword 0.
TileCoefficients decoded_coefficients(const Codebook& codebook,
                                      std::uint16_t index,
                                      std::uint16_t mean);

/// Complements a shape's elements at the upper node along s; a second call undoes the first.
/// Distances between shapes stay the same, and the sum becomes the slope along s, which differs
/// more between shapes.
Tile folded_shape(const Tile& shape);

/// The codewords in the form in which they are searched, trained and kept in order: folded shapes,
/// or plain tiles as they are.
std::vector<Tile> searched_codewords(const Codebook& codebook);

/// The inverse of searched_codewords(). `mean_step`: 0 where `codewords` are plain tiles.
Codebook codebook_of_searched(std::vector<Tile> codewords, int mean_step);

/// Sum of a tile's elements: its DC coefficient before scaling.
std::uint32_t tile_sum(const Tile& tile);

/// The order in which a codebook is kept.
bool codeword_less(const Tile& a, const Tile& b);

/// Why a codebook is not usable; empty when it is. Reasons are a size not in 1 ... 65536, a
/// codeword 0 that is not zero, broken order, and an invalid mean step.
std::vector<std::string> problems(const Codebook& codebook);

}  // namespace af
