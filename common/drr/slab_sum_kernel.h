// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <stdint.h>

namespace af {

/// Nodes that an interpolation takes along one axis.
inline constexpr int kSumTaps = 4;

/// Where each column or row of the sum lies in a slab's image, ascending. All arrays are readable
/// for 48 entries beyond the last one.
struct SumTaps {
  int32_t* first;            ///< column or row of the slab's image that the first tap takes
  float* weights[kSumTaps];  ///< Lagrange's polynomial through the four nodes around it
  float* slopes[kSumTaps];   ///< their derivatives, per column or row of the slab's image
};

/// Fills `count` entries, at start + i step (limited to the image), for a slab's image of at least
/// kSumTaps columns or rows.
using PlaceTaps =
    void (*)(float start, float step, int32_t nodes, int32_t count, const SumTaps& taps);

/// One slab that is added to a sum: images of the value and, when wanted, of its slopes along the
/// source's x and z. Images are readable for 32 values beyond the columns that taps take.
struct SlabTerm {
  const float* images[3];  ///< null [1] and [2]: not wanted
  int32_t stride;
  int32_t columns;
  SumTaps s, t;
  /// How far, in nodes along s and t, a node of the sum moves in the slab's image per mm that the
  /// source moves along x and z. The value's slopes along s and t, times these, add to its slopes
  /// along the source's x and z.
  float drift[2];
  float* rows[3];  ///< room for the slab's images between two rows, plus 48 values
  float* sum[3];
  int32_t sum_stride;
  int32_t sum_columns;
  int32_t sum_rows;
  bool adds;  ///< whether the slab is added to the sum instead of replacing it
};

using AddSlab = void (*)(const SlabTerm& term);

#define AF_DECLARE_KERNELS(space)                                                              \
  namespace space {                                                                            \
  void place_taps(float start, float step, int32_t nodes, int32_t count, const SumTaps& taps); \
  void add_slab(const SlabTerm& term);                                                         \
  }
AF_DECLARE_KERNELS(kernels_128)
AF_DECLARE_KERNELS(kernels_256)
AF_DECLARE_KERNELS(kernels_512)
#undef AF_DECLARE_KERNELS

}  // namespace af
