// SPDX-License-Identifier: Apache-2.0
#include "precompute/codebook/nearest_codeword.h"

#include <algorithm>
#include <bit>
#include <numeric>

#include "base/error.h"
#include "base/vector_width.h"
#include "field/tile.h"

namespace af {

namespace {

constexpr std::size_t kBlockCodewords = 16;
// Farther than any tile, but its square is still a float.
constexpr float kFarAway = 1e18f;
/// A box has 16 children.
constexpr int kHalvingsOfBox = 4;

CodewordBox far_box() {
  CodewordBox box{};
  for (std::size_t k = 0; k < kBoxCoefficients; ++k) {
    std::ranges::fill(box.low[k], kFarAway);
    std::ranges::fill(box.high[k], kFarAway);
  }
  return box;
}

}  // namespace

/// The codewords below one node of the tree of boxes.
struct NearestCodeword::Part {
  std::span<std::uint32_t> codewords;
  int halvings = 0;          ///< between it and the root
  std::uint32_t number = 0;  ///< among the parts with as many halvings
};

NearestCodeword::NearestCodeword(const Codebook& codebook) : mean_step_(codebook.mean_step) {
  throw_if_any(problems(codebook));
  codewords_ = searched_codewords(codebook);
  if (codebook.has_means())
    make_boxes();
  else
    sort_by_dc();
}

void NearestCodeword::sort_by_dc() {
  const std::size_t count = codewords_.size();
  const std::size_t blocks = (count + kBlockCodewords - 1) / kBlockCodewords;
  coefficients_.assign(blocks * kTileElements * kBlockCodewords, kFarAway);
  indices_.resize(blocks * kBlockCodewords);
  std::iota(indices_.begin(), indices_.end(), 0u);
  low_dc_.assign(blocks + 2, kFarAway);
  high_dc_.assign(blocks + 2, kFarAway);
  low_dc_.front() = high_dc_.front() = -kFarAway;
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t block = i / kBlockCodewords;
    const std::size_t lane = i % kBlockCodewords;
    float* of_block = &coefficients_[block * kTileElements * kBlockCodewords];
    const TileCoefficients coefficients = hadamard_coefficients(codewords_[i]);
    for (std::size_t k = 0; k < kTileElements; ++k)
      of_block[k * kBlockCodewords + lane] = coefficients[kCoefficientOrder[k]];
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

void NearestCodeword::make_boxes() {
  for (const Tile& codeword : codewords_) {
    auto& transformed = transformed_.emplace_back();
    const TileCoefficients coefficients = hadamard_coefficients(codeword);
    for (std::size_t k = 0; k < kTileElements; ++k)
      transformed[k] = coefficients[kFoldedCoefficientOrder[k]];
  }
  const std::size_t blocks =
      std::bit_ceil((codewords_.size() + kBlockCodewords - 1) / kBlockCodewords);
  const int halvings = std::countr_zero(blocks);
  box_levels_ = std::max(1, (halvings + kHalvingsOfBox - 1) / kHalvingsOfBox);
  coefficients_.assign(blocks * kTileElements * kBlockCodewords, kFarAway);
  indices_.assign(blocks * kBlockCodewords, 0);
  for (int level = 0; level < box_levels_; ++level)
    boxes_[static_cast<std::size_t>(level)].assign(
        std::max<std::size_t>(
            1, blocks >> static_cast<unsigned>(kHalvingsOfBox * (box_levels_ - level))),
        far_box());
  std::vector<std::uint32_t> all(codewords_.size());
  std::iota(all.begin(), all.end(), 0u);
  split({all, kHalvingsOfBox * box_levels_ - halvings, 0});
  transformed_ = {};
}

/// `part.halvings` counts as if the root had 16 children.
void NearestCodeword::split(const Part& part) {
  if (part.codewords.empty()) return;
  if (part.halvings % kHalvingsOfBox == 0 && part.halvings > 0) set_box(part);
  if (part.halvings == kHalvingsOfBox * box_levels_) {
    set_block(part);
    return;
  }
  const auto value_of = [&](std::size_t k) {
    return [this, k](std::uint32_t codeword) { return transformed_[codeword][k]; };
  };
  const auto count = static_cast<double>(part.codewords.size());
  double widest = -1.0;
  std::size_t coefficient = 0;
  for (std::size_t k = 0; k < kTileElements; ++k) {
    double sum = 0.0;
    double squares = 0.0;
    for (const std::uint32_t codeword : part.codewords) {
      const auto value = static_cast<double>(transformed_[codeword][k]);
      sum += value;
      squares += value * value;
    }
    if (const double variance = squares / count - sum / count * (sum / count); variance > widest) {
      widest = variance;
      coefficient = k;
    }
  }
  const auto value = value_of(coefficient);
  const std::size_t half = (part.codewords.size() + 1) / 2;
  std::nth_element(part.codewords.begin(),
                   part.codewords.begin() + static_cast<std::ptrdiff_t>(half) - 1,
                   part.codewords.end(),
                   [&](std::uint32_t a, std::uint32_t b) {
                     return std::pair(value(a), a) < std::pair(value(b), b);
                   });
  split({part.codewords.first(half), part.halvings + 1, 2 * part.number});
  split({part.codewords.subspan(half), part.halvings + 1, 2 * part.number + 1});
}

void NearestCodeword::set_box(const Part& child) {
  const int level = child.halvings / kHalvingsOfBox - 1;
  CodewordBox& box = boxes_[static_cast<std::size_t>(level)][child.number / kBlockCodewords];
  const std::size_t lane = child.number % kBlockCodewords;
  for (std::size_t k = 0; k < kBoxCoefficients; ++k) {
    float low = kFarAway;
    float high = -kFarAway;
    for (const std::uint32_t codeword : child.codewords) {
      low = std::min(low, transformed_[codeword][k]);
      high = std::max(high, transformed_[codeword][k]);
    }
    box.low[k][lane] = low;
    box.high[k][lane] = high;
  }
}

void NearestCodeword::set_block(const Part& part) {
  std::ranges::sort(part.codewords);
  float* const of_block = &coefficients_[part.number * kTileElements * kBlockCodewords];
  for (std::size_t lane = 0; lane < part.codewords.size(); ++lane) {
    const std::uint32_t codeword = part.codewords[lane];
    indices_[part.number * kBlockCodewords + lane] = codeword;
    for (std::size_t k = 0; k < kTileElements; ++k)
      of_block[k * kBlockCodewords + lane] = transformed_[codeword][k];
  }
}

void NearestCodeword::search(std::span<const Tile> tiles,
                             SearchHint hint,
                             std::span<std::uint32_t> nearest,
                             std::span<std::uint64_t> squared_errors) const {
  check(nearest.size() == tiles.size() && squared_errors.size() == tiles.size(),
        "one answer and one error per tile");
  if (tiles.empty()) return;
  std::array<const CodewordBox*, kMostBoxLevels> boxes{};
  for (std::size_t level = 0; level < boxes.size(); ++level) boxes[level] = boxes_[level].data();
  const bool has_boxes = box_levels_ > 0;
  const CodewordBlocks blocks{coefficients_.data(),
                              indices_.data(),
                              codewords_.front().data(),
                              has_boxes ? nullptr : low_dc_.data() + 1,
                              has_boxes ? nullptr : high_dc_.data() + 1,
                              start_block_.data(),
                              boxes.data(),
                              box_levels_};
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
