// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <stdint.h>

namespace af {

/// The tiles of one pair of viewpoint pairs: indices [s_tiles][t_tiles], codewords of 16 elements.
/// With means, [s_tiles][2][t_tiles], and codewords are shapes as in a Codebook.
struct TilePlane {
  const uint16_t* indices;
  const uint16_t* codewords;
  int32_t s_tiles;
  int32_t t_tiles;
  bool has_means;
};

/// Decodes the four viewpoints (du, dv) = 00, 01, 10, 11 of a tile plane into `planes`, each [t][s]
/// with `stride` samples from row to row. Null: not wanted.
using DecodeTiles = void (*)(const TilePlane& tiles, int32_t stride, uint16_t* const planes[4]);

/// out[r][c] = round(sum of w_i w_j in[2r + i][2c + j]), w = (1 3 3 1)/8; exact integers. `sums`
/// holds 2 columns + 2 values.
using HalvePlane = void (*)(const uint16_t* in,
                            int32_t stride,
                            int32_t rows,
                            int32_t columns,
                            uint32_t* sums,
                            uint16_t* out);

#define AF_DECLARE_KERNELS(space)                                                       \
  namespace space {                                                                     \
  void decode_tiles(const TilePlane& tiles, int32_t stride, uint16_t* const planes[4]); \
  void halve_plane(const uint16_t* in,                                                  \
                   int32_t stride,                                                      \
                   int32_t rows,                                                        \
                   int32_t columns,                                                     \
                   uint32_t* sums,                                                      \
                   uint16_t* out);                                                      \
  }
AF_DECLARE_KERNELS(kernels_128)
AF_DECLARE_KERNELS(kernels_256)
AF_DECLARE_KERNELS(kernels_512)
#undef AF_DECLARE_KERNELS

}  // namespace af
