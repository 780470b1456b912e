// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <stdint.h>

namespace af {

/// Taps of a sum, each with its weight and the place of its first value.
struct WeightedTaps {
  const int64_t* offsets;
  const float* weights;
  int32_t count;
};

/// sums[i] = the sum of weights[k] in[offsets[k] + i] over the taps, in their order, for i = 0 ...
/// count - 1. No value beyond these is read or written.
using SumWeightedVoxels = void (*)(const uint16_t* in,
                                   const WeightedTaps& taps,
                                   int64_t count,
                                   float* sums);
using SumWeightedValues = void (*)(const float* in,
                                   const WeightedTaps& taps,
                                   int64_t count,
                                   float* sums);

#define AF_DECLARE_KERNELS(space)                                                                  \
  namespace space {                                                                                \
  void sum_weighted_voxels(const uint16_t* in,                                                     \
                           const WeightedTaps& taps,                                               \
                           int64_t count,                                                          \
                           float* sums);                                                           \
  void sum_weighted_values(const float* in, const WeightedTaps& taps, int64_t count, float* sums); \
  }
AF_DECLARE_KERNELS(kernels_128)
AF_DECLARE_KERNELS(kernels_256)
AF_DECLARE_KERNELS(kernels_512)
#undef AF_DECLARE_KERNELS

}  // namespace af
