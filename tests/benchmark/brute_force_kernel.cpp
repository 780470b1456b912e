// SPDX-License-Identifier: Apache-2.0
// Exact nearest codeword by comparing every tile with every codeword, as fast as this plain method
// allows: 16 codewords to a vector, four tiles to every load, and a fused multiply-add where the
// width has one. Differences come before squares, so that floats are nearly exact. Compiled once
// per vector width.
#include "benchmark/brute_force_kernel.h"

#include "base/processor.h"

namespace af::AF_KERNEL_NAMESPACE {

using namespace lanes16;

namespace {

constexpr int kTilesAtOnce = 4;
constexpr int kElements = 16;

AF_KERNEL_INLINE Floats16 add_square(Floats16 sum, Floats16 value) {
  return multiply_add(value, value, sum);
}

AF_KERNEL_INLINE uint64_t exact_error(const uint16_t* a, const uint16_t* b) {
  uint64_t sum = 0;
  for (int i = 0; i < kElements; ++i) {
    const int64_t difference = static_cast<int64_t>(a[i]) - static_cast<int64_t>(b[i]);
    sum += static_cast<uint64_t>(difference * difference);
  }
  return sum;
}

struct Nearest {
  uint64_t error;
  float limit;  ///< a codeword with a larger float sum is surely farther
  uint32_t index;
};

/// Floats only rule out what is surely farther; integers decide the rest. Ties take the lowest
/// index.
AF_KERNEL_INLINE void offer_block(const benchmark::BruteForceCodebook& codebook,
                                  uint32_t block,
                                  const uint16_t* tile,
                                  Floats16 sums,
                                  Nearest& nearest) {
  for (int lane = 0; lane < kLanes; ++lane) {
    if (sums[lane] > nearest.limit) continue;
    const uint32_t index = codebook.order[block * kLanes + static_cast<uint32_t>(lane)];
    const uint64_t error =
        exact_error(tile, codebook.codewords + static_cast<size_t>(index) * kElements);
    // A sum of 16 rounded squares of exact differences errs by less than 17 * 2^-24 of itself.
    if (error < nearest.error || (error == nearest.error && index < nearest.index))
      nearest = {error, static_cast<float>(error) * (1.0f + 0x1.0p-18f), index};
  }
}

/// There are always kTilesAtOnce `tiles`; places past the last tile repeat it.
AF_KERNEL_INLINE void search_together(const benchmark::BruteForceCodebook& codebook,
                                      const uint16_t* const (&tiles)[kTilesAtOnce],
                                      Nearest (&nearest)[kTilesAtOnce]) {
  float elements[kElements][kTilesAtOnce];
  for (int tile = 0; tile < kTilesAtOnce; ++tile) {
    for (int i = 0; i < kElements; ++i) elements[i][tile] = tiles[tile][i];
    const uint64_t error = exact_error(tiles[tile], codebook.codewords);
    nearest[tile] = {error, static_cast<float>(error) * (1.0f + 0x1.0p-18f), 0};
  }
  for (uint32_t block = 0; block < codebook.block_count; ++block) {
    const float* lanes = codebook.elements + static_cast<size_t>(block) * kElements * kLanes;
    Floats16 sum_0 = {};
    Floats16 sum_1 = {};
    Floats16 sum_2 = {};
    Floats16 sum_3 = {};
    for (int i = 0; i < kElements; ++i) {
      const Floats16 codewords = load<Floats16>(lanes + i * kLanes);
      sum_0 = add_square(sum_0, codewords - elements[i][0]);
      sum_1 = add_square(sum_1, codewords - elements[i][1]);
      sum_2 = add_square(sum_2, codewords - elements[i][2]);
      sum_3 = add_square(sum_3, codewords - elements[i][3]);
    }
    if (any(sum_0 <= nearest[0].limit)) offer_block(codebook, block, tiles[0], sum_0, nearest[0]);
    if (any(sum_1 <= nearest[1].limit)) offer_block(codebook, block, tiles[1], sum_1, nearest[1]);
    if (any(sum_2 <= nearest[2].limit)) offer_block(codebook, block, tiles[2], sum_2, nearest[2]);
    if (any(sum_3 <= nearest[3].limit)) offer_block(codebook, block, tiles[3], sum_3, nearest[3]);
  }
}

}  // namespace

void brute_force_nearest(const benchmark::BruteForceCodebook& codebook,
                         const uint16_t* tiles,
                         size_t tile_count,
                         uint32_t* nearest) {
  for (size_t first = 0; first < tile_count; first += kTilesAtOnce) {
    const uint16_t* together[kTilesAtOnce];
    for (size_t i = 0; i < kTilesAtOnce; ++i) {
      const size_t tile = first + i < tile_count ? first + i : tile_count - 1;
      together[i] = tiles + tile * kElements;
    }
    Nearest answers[kTilesAtOnce];
    search_together(codebook, together, answers);
    for (size_t i = 0; i < kTilesAtOnce && first + i < tile_count; ++i)
      nearest[first + i] = answers[i].index;
  }
}

}  // namespace af::AF_KERNEL_NAMESPACE
