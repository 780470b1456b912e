// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <stdint.h>

namespace af {

/// What a tile of one pair of viewpoints along one axis adds to the nodes of a (s or t) tile:
/// weights of the 16 elements of a codeword, and the weights' slopes.
struct alignas(64) TileTap {
  float weights[16];
  float slopes[16];  ///< derivatives of the weights with respect to the source
  int64_t offset;    ///< of the pair's tiles in the index array
};

/// The tiles of one column of an image of (s,t) nodes: two nodes wide, every tile two high.
struct TileStrip {
  const uint16_t* indices;    ///< the column's first tile of viewpoints (0, 0)
  const uint16_t* codewords;  ///< 16 levels each; null where tiles have means
  const int16_t* shapes;      ///< otherwise: 16 differences from the mean each
  int64_t mean_offset;        ///< from a tile's index to its mean, where it has one
  const TileTap* u_taps;
  int32_t u_count;
  const TileTap* v_taps;  ///< taps v_begin[d] ... v_begin[d + 1] - 1 belong to tile d
  const int32_t* v_begin;
  int32_t tile_begin;  ///< tiles to blend, along t
  int32_t tile_end;
  /// Images [t][s] at the nodes of tile 0: value, and slopes along the source's x and z. Null: not
  /// wanted.
  float* images[3];
  int64_t stride;  ///< from image row to image row
};

/// Blends the tiles of a strip: sums of u weight x v weight x element over the taps.
using BlendTiles = void (*)(const TileStrip& strip);

/// Most viewpoints that an interpolation takes along one axis.
inline constexpr int kMostTaps = 4;

/// Where the rays of one (s or t) coordinate through the source meet the viewpoints along one axis.
struct ViewpointTap {
  int32_t first;             ///< viewpoint that weights[0] belongs to
  float weights[kMostTaps];  ///< weights of first, first + 1, ...
  float slopes[kMostTaps];   ///< their derivatives with respect to the source, per mm
};

/// A rectangle of (s,t) nodes whose rays pass between the same viewpoints.
struct SampleBlock {
  const uint16_t* samples;  ///< at the first node and viewpoint; readable for 16 beyond each row
  int64_t u_stride;         ///< from viewpoint to viewpoint
  int64_t v_stride;
  int64_t t_stride;                   ///< from row to row of the nodes
  int32_t taps;                       ///< viewpoints along each axis
  const float* u_weights[kMostTaps];  ///< one per column of nodes
  const float* u_slopes[kMostTaps];   ///< their derivatives with respect to the source
  const ViewpointTap* v_taps;         ///< one per row of nodes
  /// Images: value, and slopes along the source's x and z. Null: not wanted. Up to 15 nodes beyond
  /// each row of the block are written, too.
  float* images[3];
  int64_t image_stride;
  int32_t columns;
  int32_t rows;
};

using BlendSamples = void (*)(const SampleBlock& block);

#define AF_DECLARE_KERNELS(space)               \
  namespace space {                             \
  void blend_tiles(const TileStrip& strip);     \
  void blend_samples(const SampleBlock& block); \
  }
AF_DECLARE_KERNELS(kernels_128)
AF_DECLARE_KERNELS(kernels_256)
AF_DECLARE_KERNELS(kernels_512)
#undef AF_DECLARE_KERNELS

}  // namespace af
