// SPDX-License-Identifier: Apache-2.0
#include "ct/blurred_volume_kernel.h"

#include "base/processor.h"

namespace af::AF_KERNEL_NAMESPACE {

namespace {

using native::Floats;
using native::kLanes;

/// Vectors that are summed at once, so that additions need not wait for each other.
constexpr int kVectors = 4;

template <typename Value>
AF_KERNEL_INLINE void sum(const Value* in, const WeightedTaps& taps, int64_t count, float* sums) {
  int64_t i = 0;
  for (; i + kVectors * kLanes <= count; i += kVectors * kLanes) {
    Floats totals[kVectors] = {};
    for (int32_t k = 0; k < taps.count; ++k) {
      const Value* from = in + taps.offsets[k] + i;
      const Floats weight = native::splat(taps.weights[k]);
#pragma GCC unroll 4
      for (int j = 0; j < kVectors; ++j) totals[j] += weight * native::load(from + j * kLanes);
    }
    for (int j = 0; j < kVectors; ++j) native::store(sums + i + j * kLanes, totals[j]);
  }
  for (; i < count; ++i) {
    float total = 0.0f;
    for (int32_t k = 0; k < taps.count; ++k)
      total += taps.weights[k] * static_cast<float>(in[taps.offsets[k] + i]);
    sums[i] = total;
  }
}

}  // namespace

void sum_weighted_voxels(const uint16_t* in, const WeightedTaps& taps, int64_t count, float* sums) {
  sum(in, taps, count, sums);
}

void sum_weighted_values(const float* in, const WeightedTaps& taps, int64_t count, float* sums) {
  sum(in, taps, count, sums);
}

}  // namespace af::AF_KERNEL_NAMESPACE
