// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <stdint.h>

namespace af {

/// What a tile of one pair of viewpoints along one axis adds to the nodes of a (s or t) tile:
/// weights of the 16 elements of a codeword, and their slopes.
struct alignas(64) TileTap {
  float weights[16];
  float slopes[16];  ///< derivatives of the weights with respect to the source
  int64_t offset;    ///< of the pair's tiles in the index array
};

/// The tiles of one column of an image of (s,t) nodes: two nodes wide, every tile two high.
struct TileStrip {
  const uint16_t* indices;    ///< of the column's first tile of viewpoints (0, 0)
  const uint16_t* codewords;  ///< 16 elements each
  const TileTap* u_taps;
  int32_t u_count;
  const TileTap* v_taps;  ///< taps v_begin[d] ... v_begin[d + 1] - 1 belong to tile d
  const int32_t* v_begin;
  int32_t tile_begin;  ///< tiles to blend, along t
  int32_t tile_end;
  /// Images [t][s] at the nodes of tile 0: value, slopes along u and v (null: not wanted).
  float* images[3];
  int64_t stride;  ///< from image row to image row
};

/// Blends the tiles of a strip: sums of u weight x v weight x element over the taps.
using BlendTiles = void (*)(const TileStrip& strip);

/// Most viewpoints that an interpolation takes along one axis.
inline constexpr int kMostTaps = 4;

/// A run of (s,t) nodes along s whose rays pass between the same viewpoints.
struct SampleRun {
  const uint16_t* samples;  ///< of the run's first viewpoint; readable for 16 beyond the run
  int64_t u_stride;         ///< from viewpoint to viewpoint
  int64_t v_stride;
  int32_t taps;                       ///< viewpoints along each axis
  const float* u_weights[kMostTaps];  ///< one per node
  const float* u_slopes[kMostTaps];   ///< their derivatives with respect to the source
  float v_weights[kMostTaps];
  float v_slopes[kMostTaps];
  /// Rows of images: value, slopes along u and v (null: not wanted); written for up to 15 nodes
  /// beyond the run.
  float* images[3];
  int32_t count;
};

using BlendSamples = void (*)(const SampleRun& run);

#define AF_DECLARE_KERNELS(space)           \
  namespace space {                         \
  void blend_tiles(const TileStrip& strip); \
  void blend_samples(const SampleRun& run); \
  }
AF_DECLARE_KERNELS(kernels_128)
AF_DECLARE_KERNELS(kernels_256)
AF_DECLARE_KERNELS(kernels_512)
#undef AF_DECLARE_KERNELS

}  // namespace af
