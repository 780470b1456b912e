// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <stdint.h>

namespace af::registration {

/// Pairs of 16-bit numbers, one pair per pixel: an edge along columns and along rows. Rows are
/// `stride` pixels apart.
struct EdgePixels {
  const int16_t* first;
  int32_t stride;
};

/// Sizes in pixels.
struct CorrelatedSizes {
  int32_t width;    ///< of the pattern
  int32_t height;   ///< likewise
  int32_t columns;  ///< how many shifts along columns
  int32_t rows;     ///< likewise
};

/// products[row * columns + column] = sum of the scalar products of the pattern's edges with those
/// of the image, which begins at pixel (column, row). Exact, so that all widths give the same bits.
using CorrelateEdges = void (*)(const EdgePixels& pattern,
                                const EdgePixels& image,
                                const CorrelatedSizes& sizes,
                                int32_t* products);

#define AF_DECLARE_KERNELS(space)                    \
  namespace space {                                  \
  void correlate_edges(const EdgePixels& pattern,    \
                       const EdgePixels& image,      \
                       const CorrelatedSizes& sizes, \
                       int32_t* products);           \
  }
AF_DECLARE_KERNELS(kernels_128)
AF_DECLARE_KERNELS(kernels_256)
AF_DECLARE_KERNELS(kernels_512)
#undef AF_DECLARE_KERNELS

}  // namespace af::registration
