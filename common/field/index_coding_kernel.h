// SPDX-License-Identifier: Apache-2.0
// Interface of the kernels that code blocks of indices (see index_coding.h), one function per
// vector width. Raw pointers only: the kernels are compiled for instruction sets that the rest of
// the program may not use.
#pragma once

#include <stdint.h>

namespace af {

/// How likely a bit is one, learned from those before it.
struct AdaptiveBit {
  uint16_t one = 1u << 15u;  ///< of 65536
  uint16_t seen = 0;         ///< bits so far, up to where learning slows no further
};

/// Levels of a CodewordTree that are stored together.
inline constexpr int kLevelsOfCluster = 4;
inline constexpr int kNodesOfCluster = 1 << kLevelsOfCluster;

/// The nodes of four levels of a CodewordTree: the uppermost at 1, children of n at 2n and 2n + 1.
/// A path that reaches a number n above 15 goes on in the cluster `child` + n - 16 of the next
/// level. In two lines of the cache, and as vectors.
struct alignas(64) NodeCluster {
  float thresholds[kNodesOfCluster];  ///< midway between the halves
  /// 16 q + c: c is the number of the coefficient that is split, q its standard deviation in
  /// quarters of an octave.
  int32_t splits[kNodesOfCluster];
};

/// The codebook as the kernels want it.
struct CodewordTables {
  /// As a tree in which cluster c has the children 16c + 1 ... 16c + 16.
  const NodeCluster* clusters;
  uint32_t first_node;           ///< of cluster 0, the only one that may lack levels
  const uint16_t* codewords_at;  ///< of the leaves; 0 for nodes that split: 1, then 2n and 2n + 1
  int32_t depth;                 ///< levels of nodes; all leaves lie below the last two
  const float* coefficients;     ///< 16 per codeword; of codeword 0 zeros
  const uint32_t* leaves;        ///< node of each codeword
  uint32_t codeword_count;
  int32_t mean_step;  ///< 0: tiles have no means
};

/// What is kept of a tile until those that it helps to predict are done.
struct TileNote {
  float surprise;  ///< error of its prediction; 0 when the tile is empty
  uint16_t codeword;
  uint16_t state;  ///< kMissing, kEmpty, kOccupied
};
inline constexpr uint16_t kMissing = 0;
inline constexpr uint16_t kEmpty = 1;
inline constexpr uint16_t kOccupied = 2;

/// These numbers are part of the file format: other numbers make another coding.
inline constexpr int kSurpriseClasses = 24;
inline constexpr int kDistances = 32;  ///< of a prediction from a threshold, with their sign
inline constexpr int kWidths = 16;     ///< of a node against the usual error
inline constexpr int kOrders = 3;      ///< mean, slopes, the rest
inline constexpr int kEmptyContexts = 3 * 3 * 3 * 3 * 3;

/// Models of the difference between a mean and its prediction, one set per size of the usual
/// difference: whether it is zero, and its sign, by the prediction's distance from its nearest
/// step; how many bits it has; and these bits from the highest on.
inline constexpr int kMeanSpreads = 32;
inline constexpr int kMeanBits = 16;
inline constexpr int kMeanOffsets = 4;
inline constexpr int kModelsOfSpread = 2 * kMeanOffsets + kMeanBits + 3 * kMeanBits;
inline constexpr int kMeanModels = kMeanSpreads * kModelsOfSpread;

inline constexpr int kNotesBeyond = 4;  ///< that prefetching may read

/// What a coder learns within a block, and its notes. Starts as zeros and initial models.
struct BlockMemory {
  AdaptiveBit* turns;    ///< [order][distance][width]
  AdaptiveBit* empties;  ///< kEmptyContexts
  /// Recent errors of the predictions of each coefficient, [surprise class][16].
  float* errors;
  int32_t* octaves;  ///< of the errors, in quarters
  /// [u % 2][v][1 + s + 1][1 + t + 1]: tiles beyond the borders are missing. kNotesBeyond follow.
  TileNote* notes;
  AdaptiveBit* mean_models;  ///< kMeanModels; of tiles with means
  float* sums;               ///< of these, too: 16 times the mean of the tile of each note
};

/// Indices (and means) of one block, stored as Codebook says, and their bytes.
struct BlockToDecode {
  uint16_t* indices;
  const uint8_t* bytes;
  int64_t byte_count;
  bool is_exhausted;  ///< set by decoding: whether `byte_count` is what an encoder would write
};

/// Blocks of these extents.
struct BlockShape {
  int32_t u, v, s, t;
};

/// Blocks that are decoded in turns, so that one computes while another waits.
inline constexpr int kBlocksAtOnce = 4;

#define AF_DECLARE_KERNELS(space)                                                          \
  namespace space {                                                                        \
  /** Returns how many bytes there are; `bytes` has room for IndexCoding::most_bytes(). */ \
  int64_t encode_block(const CodewordTables& tables,                                       \
                       const BlockShape& shape,                                            \
                       const BlockMemory& memory,                                          \
                       const uint16_t* indices,                                            \
                       uint8_t* bytes);                                                    \
  /** One memory per block, up to kBlocksAtOnce blocks. */                                 \
  void decode_blocks(const CodewordTables& tables,                                         \
                     const BlockShape& shape,                                              \
                     const BlockMemory* memories,                                          \
                     BlockToDecode* blocks,                                                \
                     int count);                                                           \
  }
AF_DECLARE_KERNELS(kernels_128)
AF_DECLARE_KERNELS(kernels_256)
AF_DECLARE_KERNELS(kernels_512)
#undef AF_DECLARE_KERNELS

using EncodeBlock = int64_t (*)(
    const CodewordTables&, const BlockShape&, const BlockMemory&, const uint16_t*, uint8_t*);
using DecodeBlocks =
    void (*)(const CodewordTables&, const BlockShape&, const BlockMemory*, BlockToDecode*, int);

}  // namespace af
