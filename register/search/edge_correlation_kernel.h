// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <stdint.h>

namespace af::registration {

/// A pixel of a pattern: two 16-bit numbers, an edge along columns and along rows.
struct PatternPixel {
  int16_t edge[2];
  int32_t offset;  ///< in an image, in pixels from where the pattern's first pixel lies
};

/// Pairs of 16-bit numbers, one pair per pixel. Rows are `stride` pixels apart.
struct EdgePixels {
  const int16_t* first;
  int32_t stride;
};

/// Shifts of a pattern.
struct ShiftCount {
  int32_t columns;
  int32_t rows;
};

/// How far beyond the last pixel of a pattern, at its last shift, images are read, in pixels.
inline constexpr int kPixelsReadBeyond = 16;

/// products[row * columns + column] = sum over the pattern's pixels of the scalar products with the
/// image's, which begins at pixel (column, row). Exact, so that all widths give the same bits.
using CorrelateEdges = void (*)(const PatternPixel* pattern,
                                int32_t pixel_count,
                                const EdgePixels& image,
                                const ShiftCount& shifts,
                                int32_t* products);

#define AF_DECLARE_KERNELS(space)                   \
  namespace space {                                 \
  void correlate_edges(const PatternPixel* pattern, \
                       int32_t pixel_count,         \
                       const EdgePixels& image,     \
                       const ShiftCount& shifts,    \
                       int32_t* products);          \
  }
AF_DECLARE_KERNELS(kernels_128)
AF_DECLARE_KERNELS(kernels_256)
AF_DECLARE_KERNELS(kernels_512)
#undef AF_DECLARE_KERNELS

}  // namespace af::registration
