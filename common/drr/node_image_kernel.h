// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <stdint.h>

namespace af {

/// Nodes beyond an image's edge that up-sampling and slopes read, on either side.
inline constexpr int kUpsampleReach = 3;

/// Inserts a node halfway between any two neighbours along both axes, by Lagrange's polynomial
/// through six nodes (exact up to degree five). The image's edge is replicated. `in`: t_count rows
/// of s_count nodes. `out`: 2 t_count - 1 rows of 2 s_count - 1. Strides lead from row to row; that
/// of `out` is at least 2 s_count rounded up to 32. `row` holds s_count + 32 values.
using UpsampleImage = void (*)(const float* in,
                               int32_t in_stride,
                               int32_t s_count,
                               int32_t t_count,
                               float* row,
                               float* out,
                               int32_t out_stride);

/// Slopes per node along s and t: central differences, smoothed by (1 2 1)/4 across (Sobel's
/// weights over 8). The image's edge is replicated. All images share `stride`.
using SobelSlopes = void (*)(const float* in,
                             int32_t stride,
                             int32_t s_count,
                             int32_t t_count,
                             float* s_slopes,
                             float* t_slopes);

#define AF_DECLARE_KERNELS(space)          \
  namespace space {                        \
  void upsample_image(const float* in,     \
                      int32_t in_stride,   \
                      int32_t s_count,     \
                      int32_t t_count,     \
                      float* row,          \
                      float* out,          \
                      int32_t out_stride); \
  void sobel_slopes(const float* in,       \
                    int32_t stride,        \
                    int32_t s_count,       \
                    int32_t t_count,       \
                    float* s_slopes,       \
                    float* t_slopes);      \
  }
AF_DECLARE_KERNELS(kernels_128)
AF_DECLARE_KERNELS(kernels_256)
AF_DECLARE_KERNELS(kernels_512)
#undef AF_DECLARE_KERNELS

}  // namespace af
