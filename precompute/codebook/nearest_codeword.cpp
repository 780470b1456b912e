// SPDX-License-Identifier: Apache-2.0
#include "precompute/codebook/nearest_codeword.h"

#include <algorithm>
#include <bit>

#include "base/error.h"
#include "base/vector_width.h"
#include "precompute/codebook/nearest_codeword_kernel.h"

namespace af {

namespace {

constexpr std::size_t kBlockCodewords = 16;
// Farther than any tile, and its square is still a float.
constexpr float kFarAway = 1e18f;

/// Coefficient `k` of the 4-D Hadamard transform: the sum of the elements with the signs
/// (-1)^popcount(element & k).
float hadamard_coefficient(const Tile& tile, std::uint32_t k) {
  std::int32_t sum = 0;
  for (std::uint32_t i = 0; i < kTileElements; ++i) {
    const std::int32_t level = tile[i];
    sum += std::popcount(i & k) % 2 == 0 ? level : -level;
  }
  return static_cast<float>(sum);
}

}  // namespace

NearestCodeword::NearestCodeword(const Codebook& codebook) : codewords_(codebook.codewords) {
  throw_if_any(problems(codebook));
  const std::size_t count = codewords_.size();
  const std::size_t blocks = (count + kBlockCodewords - 1) / kBlockCodewords;
  coefficients_.assign(blocks * kTileElements * kBlockCodewords, kFarAway);
  low_dc_.assign(blocks + 2, kFarAway);
  high_dc_.assign(blocks + 2, kFarAway);
  low_dc_.front() = high_dc_.front() = -kFarAway;
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t block = i / kBlockCodewords;
    const std::size_t lane = i % kBlockCodewords;
    float* of_block = &coefficients_[block * kTileElements * kBlockCodewords];
    for (std::size_t k = 0; k < kTileElements; ++k)
      of_block[k * kBlockCodewords + lane] =
          hadamard_coefficient(codewords_[i], kCoefficientOrder[k]);
    const auto dc = static_cast<float>(tile_sum(codewords_[i]));
    if (lane == 0) low_dc_[block + 1] = dc;
    high_dc_[block + 1] = dc;
  }
  start_block_.resize(kStartEntries);
  std::uint32_t block = 0;
  for (std::uint32_t entry = 0; entry < kStartEntries; ++entry) {
    while (high_dc_[block + 1] < static_cast<float>(entry << kStartShift)) ++block;
    start_block_[entry] = block;
  }
}

void NearestCodeword::search(std::span<const Tile> tiles,
                             SearchHint hint,
                             std::span<std::uint32_t> nearest,
                             std::span<std::uint64_t> squared_errors) const {
  check(nearest.size() == tiles.size() && squared_errors.size() == tiles.size(),
        "one answer and one error per tile");
  if (tiles.empty()) return;
  const CodewordBlocks blocks{coefficients_.data(),
                              low_dc_.data() + 1,
                              high_dc_.data() + 1,
                              codewords_.front().data(),
                              start_block_.data(),
                              static_cast<std::uint32_t>(low_dc_.size() - 2)};
  const NearestRequest request{tiles.front().data(),
                               tiles.size(),
                               hint == SearchHint::PerTile,
                               nearest.data(),
                               squared_errors.data()};
  select_kernel<NearestFunction>(kernels_128::find_nearest,
                                 kernels_256::find_nearest,
                                 kernels_512::find_nearest)(blocks, request);
}

}  // namespace af
