// SPDX-License-Identifier: Apache-2.0
#include "register/similarity/tiled_correlation.h"

#include <cmath>

#include "base/error.h"

namespace af::registration {
namespace {

/// A DRR tile whose standard deviation is below this share of the DRR range correlates only by
/// rounding and quantisation.
constexpr double kFlatShareOfRange = 1e-3;
constexpr double kSmallestUsedShare = 0.25;

struct TileSums {
  double count = 0.0;
  double x = 0.0, xx = 0.0;
  double d = 0.0, dd = 0.0, xd = 0.0;
};

}  // namespace

TiledCorrelation::TiledCorrelation(const SimilarityReference& reference, int tiles)
    : width_(reference.xray.width),
      drr_offset_((reference.drr_range.low + reference.drr_range.high) / 2.0),
      smallest_variance_(
          std::pow(kFlatShareOfRange * (reference.drr_range.high - reference.drr_range.low), 2)) {
  throw_if_any(problems(reference));
  weights_ = pixel_weights(reference);
  xray_ = reference.xray.pixels;
  for (std::size_t i = 0; i < xray_.size(); ++i)
    if (!reference.is_used(i)) xray_[i] = 0.0f;
  const int height = reference.xray.height;
  double weight_total = 0.0;
  for (int row = 0; row < tiles; ++row)
    for (int column = 0; column < tiles; ++column) {
      const int left = column * width_ / tiles;
      const int top = row * height / tiles;
      Tile tile{static_cast<std::size_t>(top) * static_cast<std::size_t>(width_) +
                    static_cast<std::size_t>(left),
                {(column + 1) * width_ / tiles - left, (row + 1) * height / tiles - top, width_},
                0.0};
      double count = 0.0;
      double sum = 0.0;
      double square = 0.0;
      for (int r = 0; r < tile.block.height; ++r)
        for (int c = 0; c < tile.block.width; ++c) {
          const std::size_t i = tile.first +
                                static_cast<std::size_t>(r) * static_cast<std::size_t>(width_) +
                                static_cast<std::size_t>(c);
          if (!reference.is_used(i)) continue;
          const auto value = static_cast<double>(xray_[i]);
          count += 1.0;
          sum += value;
          square += value * value;
        }
      if (count < kSmallestUsedShare * tile.block.width * tile.block.height || count < 2.0)
        continue;
      tile.weight = std::sqrt(std::max(0.0, square - sum * sum / count));
      weight_total += tile.weight;
      tiles_.push_back(tile);
    }
  if (!(weight_total > 0.0))
    throw InputError("X-ray = flat or masked in every tile: use a measure without tiles");
  for (Tile& tile : tiles_) tile.weight /= weight_total;
}

double TiledCorrelation::tile_correlation(std::span<const float> drr, const Tile& tile) const {
  TileSums sums;
  for (int r = 0; r < tile.block.height; ++r)
    for (int c = 0; c < tile.block.width; ++c) {
      const std::size_t i = tile.first +
                            static_cast<std::size_t>(r) * static_cast<std::size_t>(width_) +
                            static_cast<std::size_t>(c);
      if (!weights_.empty() && weights_[i] == 0.0f) continue;
      const auto x = static_cast<double>(xray_[i]);
      const double d = static_cast<double>(drr[i]) - drr_offset_;
      sums.count += 1.0;
      sums.x += x;
      sums.xx += x * x;
      sums.d += d;
      sums.dd += d * d;
      sums.xd += x * d;
    }
  const double drr_square = sums.dd - sums.d * sums.d / sums.count;
  const double xray_square = sums.xx - sums.x * sums.x / sums.count;
  if (std::isnan(drr_square)) return drr_square;
  if (!(drr_square > smallest_variance_ * sums.count) || !(xray_square > 0.0)) return 0.0;
  return (sums.xd - sums.x * sums.d / sums.count) / std::sqrt(drr_square * xray_square);
}

double TiledCorrelation::evaluate(std::span<const float> drr,
                                  SimilarityWorkspace& /*workspace*/) const {
  check(drr.size() == xray_.size(), "the DRR must have the size of its reference");
  double sum = 0.0;
  for (const Tile& tile : tiles_) sum += tile.weight * tile_correlation(drr, tile);
  return sum;
}

NormalEquations TiledCorrelation::normal_equations(std::span<const float> drr,
                                                   std::span<const float> planes,
                                                   SimilarityWorkspace& /*workspace*/) const {
  check(drr.size() == xray_.size(), "the DRR must have the size of its reference");
  NormalEquations result;
  for (const Tile& tile : tiles_) {
    const GramSums sums =
        gram_sums(planes, drr, xray_, weights_, drr_offset_, tile.first, tile.block);
    NormalEquations part = correlation_normal_equations(sums, smallest_variance_ * sums.weight);
    part.value *= tile.weight;
    part.gradient *= tile.weight;
    part.matrix *= tile.weight;
    result += part;
  }
  return result;
}

}  // namespace af::registration
