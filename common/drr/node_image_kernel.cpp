// SPDX-License-Identifier: Apache-2.0
#include "drr/node_image_kernel.h"

#include "base/processor.h"

namespace af::AF_KERNEL_NAMESPACE {

namespace {

using native::Floats;
using native::kLanes;
using native::load;
using native::store;

/// Lagrange's polynomial through six nodes, halfway between the middle two. Weights of the nearest
/// nodes on either side come first, then those of the next ones.
constexpr float kWeights[kUpsampleReach] = {150.0f / 256.0f, -25.0f / 256.0f, 3.0f / 256.0f};

AF_KERNEL_INLINE Floats halfway(const float* const rows[2 * kUpsampleReach], int32_t at) {
  Floats sum = native::splat(0.0f);
  for (int i = 0; i < kUpsampleReach; ++i)
    sum += kWeights[i] *
           (load(rows[kUpsampleReach - 1 - i] + at) + load(rows[kUpsampleReach + i] + at));
  return sum;
}

AF_KERNEL_INLINE int32_t within(int32_t index, int32_t count) {
  return index < 0 ? 0 : (index < count ? index : count - 1);
}

/// Makes one row twice as fine.
AF_KERNEL_INLINE void upsample_row(const float* in, int32_t count, float* padded, float* out) {
  memcpy(padded + kUpsampleReach, in, sizeof(float) * static_cast<size_t>(count));
  for (int32_t i = 0; i < kUpsampleReach; ++i) {
    padded[i] = in[0];
    padded[kUpsampleReach + count + i] = in[count - 1];
  }
  const float* shifted[2 * kUpsampleReach];
  for (int i = 0; i < 2 * kUpsampleReach; ++i) shifted[i] = padded + 1 + i;
  for (int32_t i = 0; i < count; i += kLanes) {
    const Floats nodes = load(padded + kUpsampleReach + i);
    const Floats between = halfway(shifted, i);
    native::store_interleaved(out + 2 * i, nodes, between);
  }
}

}  // namespace

void upsample_image(const float* in,
                    int32_t in_stride,
                    int32_t s_count,
                    int32_t t_count,
                    float* row,
                    float* out,
                    int32_t out_stride) {
  for (int32_t t = 0; t < t_count; ++t)
    upsample_row(in + static_cast<int64_t>(t) * in_stride,
                 s_count,
                 row,
                 out + static_cast<int64_t>(2 * t) * out_stride);
  for (int32_t t = 0; t + 1 < t_count; ++t) {
    const float* rows[2 * kUpsampleReach];
    for (int32_t i = 0; i < 2 * kUpsampleReach; ++i)
      rows[i] =
          out + static_cast<int64_t>(2 * within(t + 1 - kUpsampleReach + i, t_count)) * out_stride;
    float* to = out + static_cast<int64_t>(2 * t + 1) * out_stride;
    for (int32_t s = 0; s < 2 * s_count; s += kLanes) store(to + s, halfway(rows, s));
  }
}

void sobel_slopes(const float* in,
                  int32_t stride,
                  int32_t s_count,
                  int32_t t_count,
                  float* s_slopes,
                  float* t_slopes) {
  for (int32_t t = 0; t < t_count; ++t) {
    const float* below = in + static_cast<int64_t>(within(t - 1, t_count)) * stride;
    const float* at = in + static_cast<int64_t>(t) * stride;
    const float* above = in + static_cast<int64_t>(within(t + 1, t_count)) * stride;
    float* __restrict s_row = s_slopes + static_cast<int64_t>(t) * stride;
    float* __restrict t_row = t_slopes + static_cast<int64_t>(t) * stride;
    const auto slopes_at = [&](int32_t s, int32_t left, int32_t right) {
      s_row[s] = 0.125f * (below[right] - below[left] + above[right] - above[left] +
                           2.0f * (at[right] - at[left]));
      t_row[s] = 0.125f * (above[left] - below[left] + above[right] - below[right] +
                           2.0f * (above[s] - below[s]));
    };
    slopes_at(0, 0, 1);
    for (int32_t s = 1; s + 1 < s_count; ++s) slopes_at(s, s - 1, s + 1);
    slopes_at(s_count - 1, s_count - 2, s_count - 1);
  }
}

}  // namespace af::AF_KERNEL_NAMESPACE
