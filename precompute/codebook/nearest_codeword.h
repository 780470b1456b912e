// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "field/codebook.h"

namespace af {

/// Where the search for a tile takes its first guess from. It affects only speed.
enum class SearchHint {
  None,     ///< the codewords next to the tile's DC serve: nearer than a neighbour's answer
  PerTile,  ///< the caller's guess, for example the answer of the last training iteration
};

/// Exact nearest-codeword search (squared Euclidean distance of 16 levels; ties take the lowest
/// index). Tiles and codewords are compared in the coordinates of the 4-D Hadamard transform, whose
/// first coefficient (DC) orders the codebook: blocks of 16 codewords are visited outwards from the
/// tile's DC until the DC alone is farther than the best, and left after five coefficients when all
/// 16 are. Floats decide where they are exact (sums below 2^24); above, they discard with a margin
/// above their rounding and integers decide. So the answer equals brute force on every vector
/// width. \test NearestCodeword.EqualsBruteForceOnEveryWidth
class NearestCodeword {
 public:
  explicit NearestCodeword(const Codebook& codebook);

  /// Index of the nearest codeword and squared error of every tile. With SearchHint::PerTile
  /// `nearest` holds valid indices on entry. Re-entrant.
  void search(std::span<const Tile> tiles,
              SearchHint hint,
              std::span<std::uint32_t> nearest,
              std::span<std::uint64_t> squared_errors) const;

  [[nodiscard]] std::size_t codeword_count() const { return codewords_.size(); }

 private:
  std::vector<Tile> codewords_;
  std::vector<float> coefficients_;  ///< as in CodewordBlocks
  std::vector<float> low_dc_;        ///< one guard at each end
  std::vector<float> high_dc_;
  std::vector<std::uint32_t> start_block_;
};

}  // namespace af
