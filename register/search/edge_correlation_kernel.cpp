// SPDX-License-Identifier: Apache-2.0
#include "register/search/edge_correlation_kernel.h"

#include <string.h>

#include "base/processor.h"

namespace af::registration::AF_KERNEL_NAMESPACE {
namespace {

namespace native = af::AF_KERNEL_NAMESPACE::native;

/// Each lane sums for a shift of its own, so that no lanes are summed in the end.
constexpr int32_t kShifts = native::kLanes;
static_assert(kShifts <= kPixelsReadBeyond);

/// Sums for kRegisters * kShifts neighbouring shifts, the first of which is at `image`.
template <size_t kRegisters>
AF_KERNEL_INLINE void sum_products(const PatternPixel* pattern,
                                   int32_t pixel_count,
                                   const int16_t* image,
                                   int32_t* sums) {
  native::Register sum[kRegisters];
  for (native::Register& each : sum) each = native::splat_int(0);
  for (int32_t i = 0; i < pixel_count; ++i) {
    int32_t pair;
    memcpy(&pair, pattern[i].edge, sizeof(pair));
    const native::Register edge = native::splat_int(pair);
    const int16_t* const at = image + 2 * static_cast<int64_t>(pattern[i].offset);
    for (size_t k = 0; k < kRegisters; ++k)
      sum[k] = native::add_ints(
          sum[k],
          native::multiply_add_pairs(
              edge, native::load_register(at + static_cast<size_t>(2 * kShifts) * k)));
  }
  memcpy(sums, sum, sizeof(sum));
}

}  // namespace

void correlate_edges(const PatternPixel* pattern,
                     int32_t pixel_count,
                     const EdgePixels& image,
                     const ShiftCount& shifts,
                     int32_t* products) {
  constexpr size_t kMost = 4;
  int32_t sums[kMost * static_cast<size_t>(kShifts)];
  for (int32_t row = 0; row < shifts.rows; ++row)
    for (int32_t column = 0; column < shifts.columns;) {
      const int32_t left = shifts.columns - column;
      const int16_t* const at =
          image.first + 2 * (static_cast<int64_t>(row) * image.stride + column);
      int32_t done = kShifts;
      if (left > 3 * kShifts) {
        sum_products<kMost>(pattern, pixel_count, at, sums);
        done = static_cast<int32_t>(kMost) * kShifts;
      } else if (left > kShifts) {
        sum_products<2>(pattern, pixel_count, at, sums);
        done = 2 * kShifts;
      } else {
        sum_products<1>(pattern, pixel_count, at, sums);
      }
      if (done > left) done = left;
      memcpy(products, sums, static_cast<size_t>(done) * sizeof(*products));
      products += done;
      column += done;
    }
}

}  // namespace af::registration::AF_KERNEL_NAMESPACE
