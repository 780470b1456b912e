// SPDX-License-Identifier: Apache-2.0
#include "drr/tile_filter_kernel.h"

#include "base/processor.h"

namespace af::AF_KERNEL_NAMESPACE {

namespace {

using native::Floats;
using native::Ints;
using native::kLanes;
using native::load;
using native::splat;

using Weights = const float (*)[33];

constexpr int kElements = 16;

/// A block of tiles along s.
struct Block {
  const FilterRow* row;
  int32_t first_s;
};

/// Where the neighbours of a block have their coefficient 0: this many steps along one axis (0 ...
/// 3: u, v, s, t), and along another.
AF_KERNEL_INLINE const float* neighbour(
    const Block& block, int a, int a_side, int b = 0, int b_side = 0) {
  int offset[4] = {};
  offset[a] += a_side;
  offset[b] += b_side;
  return block.row->tiles[3 * (offset[0] + 1) + offset[1] + 1] + offset[3] * block.row->row_stride +
         block.first_s + offset[2];
}

/// Adds a sum and a difference of two neighbours.
AF_KERNEL_INLINE void add_axis(const Block& block, int axis, Weights weights, Floats* estimates) {
  const float* next = neighbour(block, axis, 1);
  const float* before = neighbour(block, axis, -1);
  const int bit = 8 >> axis;
  const int input = 1 + 2 * axis;
  const int64_t stride = block.row->coefficient_stride;
#pragma GCC unroll 16
  for (int k = 0; k < kElements; ++k) {
    const Floats a = load(next + k * stride);
    const Floats b = load(before + k * stride);
    estimates[k] += splat(weights[k][input]) * (a + b);
    estimates[k ^ bit] += splat(weights[k ^ bit][input + 1]) * (a - b);
  }
}

/// Adds the sum and the differences of four neighbours across two axes.
AF_KERNEL_INLINE void add_pair(
    const Block& block, int a, int b, int input, Weights weights, Floats* estimates) {
  const float* both = neighbour(block, a, 1, b, 1);
  const float* of_a = neighbour(block, a, 1, b, -1);
  const float* of_b = neighbour(block, a, -1, b, 1);
  const float* none = neighbour(block, a, -1, b, -1);
  const int bit_a = 8 >> a;
  const int bit_b = 8 >> b;
  const int64_t stride = block.row->coefficient_stride;
#pragma GCC unroll 16
  for (int k = 0; k < kElements; ++k) {
    const Floats upper = load(both + k * stride);
    const Floats lower = load(of_a + k * stride);
    const Floats upper_before = load(of_b + k * stride);
    const Floats lower_before = load(none + k * stride);
    const Floats upper_sum = upper + upper_before;
    const Floats lower_sum = lower + lower_before;
    const Floats upper_step = upper - upper_before;
    const Floats lower_step = lower - lower_before;
    const int j = k ^ bit_a;
    estimates[k] += splat(weights[k][input]) * (upper_sum + lower_sum);
    estimates[j] += splat(weights[j][input + 1]) * (upper_step + lower_step);
    estimates[k ^ bit_b] += splat(weights[k ^ bit_b][input + 2]) * (upper_sum - lower_sum);
    estimates[j ^ bit_b] += splat(weights[j ^ bit_b][input + 3]) * (upper_step - lower_step);
  }
}

/// Levels of tiles from their coefficients: the inverse transform, rounded and limited.
AF_KERNEL_INLINE void to_levels(Floats* values) {
  for (int stride = 1; stride < kElements; stride *= 2)
    for (int i = 0; i < kElements; ++i) {
      if ((i & stride) != 0) continue;
      const Floats a = values[i];
      const Floats b = values[i | stride];
      values[i] = a + b;
      values[i | stride] = a - b;
    }
  for (int i = 0; i < kElements; ++i)
    values[i] = native::minimum(
        native::maximum(values[i] * splat(1.0f / kElements) + splat(0.5f), splat(0.0f)),
        splat(65535.0f));
}

}  // namespace

void filter_tile_row(const FilterRow& row, Weights weights, uint16_t* const rows[8]) {
  for (int32_t s = 0; s < row.s_tiles; s += kLanes) {
    const Block block{&row, s};
    const float* own = neighbour(block, 0, 0);
    Floats estimates[kElements];
    Ints is_empty = splat(-1);
    for (int k = 0; k < kElements; ++k) {
      const Floats coefficient = load(own + k * row.coefficient_stride);
      is_empty &= coefficient == splat(0.0f);
      estimates[k] = coefficient + splat(weights[k][0]) * coefficient;
    }
#pragma GCC unroll 4
    for (int axis = 0; axis < 4; ++axis) add_axis(block, axis, weights, estimates);
    int input = 9;
#pragma GCC unroll 4
    for (int a = 0; a < 4; ++a)
#pragma GCC unroll 4
      for (int b = a + 1; b < 4; ++b, input += 4) add_pair(block, a, b, input, weights, estimates);
    to_levels(estimates);
    for (int i = 0; i < 8; ++i) {
      // Elements at the lower and upper nodes along s are numbered 8 du + 4 dv + 2 ds + dt.
      const int lower = 4 * (i / 2) + i % 2;
      const Ints levels =
          native::to_int(estimates[lower]) | (native::to_int(estimates[lower + 2]) << 16);
      native::store(reinterpret_cast<int32_t*>(rows[i] + 2 * s), levels & ~is_empty);
    }
  }
}

}  // namespace af::AF_KERNEL_NAMESPACE
