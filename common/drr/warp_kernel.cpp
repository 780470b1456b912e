// SPDX-License-Identifier: Apache-2.0
#include "drr/warp_kernel.h"

#include "base/vec16.h"

namespace af::AF_KERNEL_NAMESPACE {

namespace {

/// Bilinear samples at 16 columns that begin at `column`.
AF_KERNEL_INLINE F16 warped(const NodeImage& image, const WarpRow& row, F16 column) {
  const F16 inverse_depth = splat(1.0f) / (row.d_0 + column * row.d_1);
  const F16 zero = splat(0.0f);
  const F16 s = maximum(zero, (row.s_0 + column * row.s_1) * inverse_depth);
  const F16 t = maximum(zero, (row.t_0 + column * row.t_1) * inverse_depth);
  const I16 s_node = minimum(to_int(s), splat(image.s_count - 2));
  const I16 t_node = minimum(to_int(t), splat(image.t_count - 2));
  const F16 s_weight = minimum(s - to_float(s_node), splat(1.0f));
  const F16 t_weight = minimum(t - to_float(t_node), splat(1.0f));
  const I16 offset = t_node * image.s_count + s_node;
  const float* next = image.values + image.s_count;
  const F16 near_low = gather(image.values, offset);
  const F16 near_high = gather(image.values + 1, offset);
  const F16 far_low = gather(next, offset);
  const F16 far_high = gather(next + 1, offset);
  const F16 near_value = near_low + s_weight * (near_high - near_low);
  const F16 far_value = far_low + s_weight * (far_high - far_low);
  return near_value + t_weight * (far_value - near_value);
}

}  // namespace

void add_warped_row(const NodeImage& image, const WarpRow& row, float* values, int32_t columns) {
  const I16 lane = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};
  int32_t column = 0;
  for (; column + kLanes <= columns; column += kLanes)
    store(values + column,
          load<F16>(values + column) + warped(image, row, to_float(lane + column)));
  if (column == columns) return;
  float rest[kLanes];
  store(rest, warped(image, row, to_float(lane + column)));
  for (int32_t i = 0; column + i < columns; ++i) values[column + i] += rest[i];
}

}  // namespace af::AF_KERNEL_NAMESPACE
