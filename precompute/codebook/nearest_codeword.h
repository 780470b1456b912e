// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "field/codebook.h"
#include "precompute/codebook/nearest_codeword_kernel.h"

namespace af {

/// Where the search for a tile gets its first guess. This affects only speed.
enum class SearchHint {
  None,     ///< none: the first codewords compared are nearer than a neighbour's answer
  PerTile,  ///< the caller's guess, for example the answer of the last training iteration
};

/// Exact nearest-codeword search (squared Euclidean distance of 16 levels; ties take the lowest
/// index). Tiles and codewords are compared in the coordinates of the 4-D Hadamard transform, whose
/// first coefficient (DC) orders the codebook. Blocks of 16 codewords are visited outwards from the
/// tile's DC until the DC alone is farther than the best. A block is left after five coefficients
/// if all 16 are farther.
/// Sums below 2^24 are exact as floats, and decide. Larger ones only discard, with a margin above
/// their rounding, and integers decide. The answer therefore equals brute force for every vector
/// width. \test NearestCodeword.EqualsBruteForceOnEveryWidth
///
/// Shapes have no coefficient as informative as the DC of plain tiles. A balanced tree halves them
/// at the median of the coefficient that varies most, down to blocks of 16. The ranges of eight
/// coefficients in each part bound the distance of its codewords. Parts are visited nearest first
/// (of the last ones, only the first of 16), until none can hold a nearer codeword.
class NearestCodeword {
 public:
  /// Searches for plain tiles or, where the codebook has means, for folded shapes (remove_mean()).
  explicit NearestCodeword(const Codebook& codebook);

  [[nodiscard]] int mean_step() const { return mean_step_; }  ///< of the codebook

  /// Finds the index of the nearest codeword and the squared error of every tile. With
  /// SearchHint::PerTile, `nearest` holds valid indices on entry. Re-entrant.
  void search(std::span<const Tile> tiles,
              SearchHint hint,
              std::span<std::uint32_t> nearest,
              std::span<std::uint64_t> squared_errors) const;

 private:
  struct Part;

  void sort_by_dc();
  void make_boxes();
  void split(const Part& part);
  void set_block(const Part& part);
  void set_box(const Part& child);

  int mean_step_;
  // Arrays as in CodewordBlocks.
  std::vector<Tile> codewords_;
  std::vector<float> coefficients_;
  std::vector<std::uint32_t> indices_;
  std::vector<float> low_dc_;  ///< one guard at each end
  std::vector<float> high_dc_;
  std::vector<std::uint32_t> start_block_;
  std::array<std::vector<CodewordBox>, kMostBoxLevels> boxes_;
  int box_levels_ = 0;

  std::vector<std::array<float, kTileElements>> transformed_;  ///< while boxes are made
};

}  // namespace af
