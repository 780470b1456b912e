// SPDX-License-Identifier: Apache-2.0
#include "register/search/edge_correlation_kernel.h"

namespace af::registration::AF_KERNEL_NAMESPACE {

void correlate_edges(const EdgePixels& pattern,
                     const EdgePixels& image,
                     const CorrelatedSizes& sizes,
                     int32_t* products) {
  const int32_t numbers = 2 * sizes.width;
  for (int32_t row = 0; row < sizes.rows; ++row)
    for (int32_t column = 0; column < sizes.columns; ++column) {
      const int16_t* a = pattern.first;
      const int16_t* b = image.first + 2 * (static_cast<int64_t>(row) * image.stride + column);
      int32_t sum = 0;
      for (int32_t y = 0; y < sizes.height; ++y) {
        // Compilers make one instruction of many products of 16 bits that are summed in 32.
        for (int32_t i = 0; i < numbers; ++i) sum += a[i] * b[i];
        a += 2 * pattern.stride;
        b += 2 * image.stride;
      }
      *products++ = sum;
    }
}

}  // namespace af::registration::AF_KERNEL_NAMESPACE
