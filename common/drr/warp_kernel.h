// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <stdint.h>

namespace af {

/// One detector row of a homography: the node coordinates of column c are (s_0 + c s_1) / (d_0 + c
/// d_1), likewise t.
struct WarpRow {
  float s_0, s_1;
  float t_0, t_1;
  float d_0, d_1;
};

/// Image of (s,t) nodes: s fastest, at least 2 x 2.
struct NodeImage {
  const float* values;
  int32_t s_count;
  int32_t t_count;
};

/// Adds the bilinearly resampled image to `columns` values of a detector row. Coordinates are
/// clamped to the image.
using AddWarpedRow = void (*)(const NodeImage& image,
                              const WarpRow& row,
                              float* values,
                              int32_t columns);

namespace kernels_128 {
void add_warped_row(const NodeImage& image, const WarpRow& row, float* values, int32_t columns);
}
namespace kernels_256 {
void add_warped_row(const NodeImage& image, const WarpRow& row, float* values, int32_t columns);
}
namespace kernels_512 {
void add_warped_row(const NodeImage& image, const WarpRow& row, float* values, int32_t columns);
}

}  // namespace af
