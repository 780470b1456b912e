// SPDX-License-Identifier: Apache-2.0
// Interface of the vectorised search, one function per vector width. It uses raw pointers only,
// because the kernels are compiled for instruction sets that the rest of the program may not use.
#pragma once

#include <stddef.h>
#include <stdint.h>

namespace af {

/// How many coefficients a CodewordBox gives ranges for, the first ones in the order of the search.
inline constexpr int kBoxCoefficients = 8;

/// Coefficient ranges of the codewords in up to 16 boxes or blocks. Unused ranges lie beyond all
/// tiles.
struct CodewordBox {
  float low[kBoxCoefficients][16];
  float high[kBoxCoefficients][16];
};

/// A codebook in the layout of the search: blocks of 16 codewords, padded with codewords that are
/// farther than any tile. It is either sorted by DC, or under a tree of boxes.
struct CodewordBlocks {
  const float* coefficients;  ///< [block][16 coefficients, in the order of the search][16 lanes]
  const uint32_t* indices;    ///< [block][16 lanes] in the codebook, ascending within a block
  const uint16_t* codewords;  ///< [index][16]
  // If sorted by DC:
  const float* low_dc;          ///< [-1 ... block_count]: DC of a block's first codeword
  const float* high_dc;         ///< [-1 ... block_count]: DC of a block's last codeword
  const uint32_t* start_block;  ///< [DC >> kStartShift]: first block whose high_dc is not below it
  // If under boxes:
  /// Level by level, the root first. Child c of box b is box 16 b + c of the level below; at the
  /// last level it is block 16 b + c.
  const CodewordBox* const* boxes;
  int32_t box_levels;  ///< 0: sorted by DC
};
/// Enough for 65536 codewords: 4096 blocks.
inline constexpr int kMostBoxLevels = 3;

inline constexpr uint32_t kStartShift = 7;
inline constexpr uint32_t kStartEntries = (16u * 65535u >> kStartShift) + 1;

/// The order of the 16 coefficients of the 4-D Hadamard transform for plain tiles, those sorted by
/// DC: DC, the four linear ones, then by falling energy in practice.
inline constexpr uint32_t kCoefficientOrder[16] = {
    0, 1, 2, 4, 8, 3, 5, 6, 9, 10, 12, 7, 11, 13, 14, 15};
/// The order for folded shapes, under boxes: the four linear ones, the remainder of the rounded
/// mean, then by falling energy in practice. Folding along s turns coefficient k into k ^ 2.
inline constexpr uint32_t kFoldedCoefficientOrder[16] = {
    0, 3, 6, 10, 2, 7, 8, 1, 4, 11, 14, 5, 9, 15, 12, 13};

/// `nearest` receives the answers. With `has_hints` it holds a guess per tile on entry.
struct NearestRequest {
  const uint16_t* tiles;  ///< [tile][16]
  size_t tile_count;
  bool has_hints;
  uint32_t* nearest;
  uint64_t* squared_errors;
};

using NearestFunction = void (*)(const CodewordBlocks&, const NearestRequest&);

namespace kernels_128 {
void find_nearest(const CodewordBlocks& blocks, const NearestRequest& request);
}
namespace kernels_256 {
void find_nearest(const CodewordBlocks& blocks, const NearestRequest& request);
}
namespace kernels_512 {
void find_nearest(const CodewordBlocks& blocks, const NearestRequest& request);
}

}  // namespace af
