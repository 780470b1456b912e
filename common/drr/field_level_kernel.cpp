// SPDX-License-Identifier: Apache-2.0
#include "drr/field_level_kernel.h"

#include <string.h>

#include "base/processor.h"

namespace af::AF_KERNEL_NAMESPACE {

namespace {

template <bool kHasMeans>
AF_KERNEL_INLINE void decode_plane(const TilePlane& tiles,
                                   int32_t stride,
                                   uint16_t* const planes[4]) {
  const int64_t row_values = kHasMeans ? int64_t{2} * tiles.t_tiles : tiles.t_tiles;
  for (int32_t d = 0; d < tiles.t_tiles; ++d)
    for (int32_t c = 0; c < tiles.s_tiles; ++c) {
      const uint16_t* const index = tiles.indices + c * row_values + d;
      const uint16_t* codeword = tiles.codewords + 16 * static_cast<int64_t>(*index);
      uint16_t levels[16];
      if constexpr (kHasMeans) {
        native::add_mean(codeword, index[tiles.t_tiles], levels);
        codeword = levels;
      }
      for (int viewpoint = 0; viewpoint < 4; ++viewpoint) {
        uint16_t* plane = planes[viewpoint];
        if (plane == nullptr) continue;
        const uint16_t* element = codeword + 4 * viewpoint;  // s0 t0, s0 t1, s1 t0, s1 t1
        uint16_t* row = plane + static_cast<int64_t>(2 * d) * stride + 2 * c;
        row[0] = element[0];
        row[1] = element[2];
        row[stride] = element[1];
        row[stride + 1] = element[3];
      }
    }
}

}  // namespace

void decode_tiles(const TilePlane& tiles, int32_t stride, uint16_t* const planes[4]) {
  tiles.has_means ? decode_plane<true>(tiles, stride, planes)
                  : decode_plane<false>(tiles, stride, planes);
}

void halve_plane(const uint16_t* in,
                 int32_t stride,
                 int32_t rows,
                 int32_t columns,
                 uint32_t* sums,
                 uint16_t* out) {
  for (int32_t row = 0; row < rows; ++row) {
    const uint16_t* a = in + static_cast<int64_t>(2 * row) * stride;
    const uint16_t* b = a + stride;
    const uint16_t* c = b + stride;
    const uint16_t* d = c + stride;
    for (int32_t i = 0; i < 2 * columns + 2; ++i)
      sums[i] = static_cast<uint32_t>(a[i] + d[i] + 3 * (b[i] + c[i]));
    uint16_t* to = out + static_cast<int64_t>(row) * columns;
    for (int32_t i = 0; i < columns; ++i)
      to[i] = static_cast<uint16_t>(
          (sums[2 * i] + sums[2 * i + 3] + 3 * (sums[2 * i + 1] + sums[2 * i + 2]) + 32) >> 6);
  }
}

}  // namespace af::AF_KERNEL_NAMESPACE
