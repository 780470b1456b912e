// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <stdint.h>

namespace af {

/// Coefficients of a row of tiles along s, and of their neighbours. `tiles[3 (du + 1) + dv + 1]` is
/// coefficient 0 of tile s = 0 of the row at the neighbour du, dv along u and v. Coefficient k lies
/// k `coefficient_stride` floats further, the next row along t `row_stride`, the next tile 1. One
/// tile before the row and kFilterRowPadding after it are read too.
struct FilterRow {
  const float* tiles[9];
  int64_t row_stride;
  int64_t coefficient_stride;
  int32_t s_tiles;
};

inline constexpr int32_t kFilterRowPadding = 17;

/// Levels of a row of tiles by a TileFilter's weights [16][33]. `rows[2 i + dt]` belongs to
/// viewpoint i = 2 du + dv of a tile, and to its lower or upper nodes along t, with s fastest.
/// Whole vectors are written, up to 2 kFilterRowPadding levels beyond the row.
using FilterTileRow = void (*)(const FilterRow& row,
                               const float (*weights)[33],
                               uint16_t* const rows[8]);

#define AF_DECLARE_KERNELS(space)                                                                  \
  namespace space {                                                                                \
  void filter_tile_row(const FilterRow& row, const float (*weights)[33], uint16_t* const rows[8]); \
  }
AF_DECLARE_KERNELS(kernels_128)
AF_DECLARE_KERNELS(kernels_256)
AF_DECLARE_KERNELS(kernels_512)
#undef AF_DECLARE_KERNELS

}  // namespace af
