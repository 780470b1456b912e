// SPDX-License-Identifier: Apache-2.0
// The plain exact search that the fast one is measured against: every tile with every codeword.
#pragma once

#include <stddef.h>
#include <stdint.h>

namespace af::benchmark {

/// Codewords of one lane group: [block][16 elements][16 lanes] as floats, padded with codewords
/// that are farther than any tile.
struct BruteForceCodebook {
  const float* elements;
  const uint16_t* codewords;  ///< [codeword][16], for the exact decision
  /// [position]: which codeword stands there. In a random order few codewords beat the best so far,
  /// in a sorted one about half do.
  const uint32_t* order;
  uint32_t block_count;
};

/// Index of the nearest codeword of each of `tile_count` tiles [tile][16]; ties take the lowest.
using BruteForceFunction = void (*)(const BruteForceCodebook& codebook,
                                    const uint16_t* tiles,
                                    size_t tile_count,
                                    uint32_t* nearest);

}  // namespace af::benchmark

namespace af::kernels_128 {
void brute_force_nearest(const benchmark::BruteForceCodebook& codebook,
                         const uint16_t* tiles,
                         size_t tile_count,
                         uint32_t* nearest);
}
namespace af::kernels_256 {
void brute_force_nearest(const benchmark::BruteForceCodebook& codebook,
                         const uint16_t* tiles,
                         size_t tile_count,
                         uint32_t* nearest);
}
namespace af::kernels_512 {
void brute_force_nearest(const benchmark::BruteForceCodebook& codebook,
                         const uint16_t* tiles,
                         size_t tile_count,
                         uint32_t* nearest);
}
