// SPDX-License-Identifier: Apache-2.0
#include "register/similarity/pattern_intensity.h"

#include <cmath>
#include <limits>

#include "base/error.h"
#include "register/similarity/pixel_sums.h"

namespace af::registration {
namespace {

constexpr int kRadiusPx = 3;
constexpr double kScaleOverRange = 10.0 / 256.0;

/// Adds up the pairs (i, i + shift) for all shifts of half the disc, so that each pair counts once.
/// Rows are taken one by one, so that no pair wraps around the image's edge.
PairSums pairs_of(float squared_scale,
                  std::span<const float> difference,
                  std::span<const float> weights,
                  int width,
                  int height) {
  const PixelSumKernels kernels = pixel_sum_kernels();
  PairSums sums{};
  for (int row_shift = 0; row_shift <= kRadiusPx; ++row_shift)
    for (int column_shift = -kRadiusPx; column_shift <= kRadiusPx; ++column_shift) {
      if (row_shift * row_shift + column_shift * column_shift > kRadiusPx * kRadiusPx) continue;
      if (row_shift == 0 && column_shift <= 0) continue;
      const int shift = row_shift * width + column_shift;
      for (int row = 0; row + row_shift < height; ++row) {
        const int first = row * width + (column_shift < 0 ? -column_shift : 0);
        // The kernel pairs i with i + shift while i + shift < count.
        const int pairs_in_row = width - std::abs(column_shift);
        const PairSums part = kernels.pair_sums(
            {difference.data() + first, weights.data() + first, shift, squared_scale},
            shift + pairs_in_row);
        sums.likeness += part.likeness;
        sums.pairs += part.pairs;
      }
    }
  return sums;
}

}  // namespace

PatternIntensity::PatternIntensity(const SimilarityReference& reference)
    : difference_(reference), width_(reference.xray.width), height_(reference.xray.height) {
  pairs_ = pairs_of(1.0f, difference_.weights(), difference_.weights(), width_, height_).pairs;
  if (!(pairs_ > 0.0))
    throw InputError("mask = no two used pixels within 3 pixels of each other: pi needs some");
}

double PatternIntensity::evaluate(std::span<const float> drr,
                                  SimilarityWorkspace& workspace) const {
  auto& mine = dynamic_cast<DifferenceWorkspace&>(workspace);
  if (!difference_.take(drr, mine)) return std::numeric_limits<double>::quiet_NaN();
  const double scale = kScaleOverRange * difference_.xray_range();
  return pairs_of(static_cast<float>(scale * scale),
                  mine.difference,
                  difference_.weights(),
                  width_,
                  height_)
             .likeness /
         pairs_;
}

std::unique_ptr<SimilarityWorkspace> PatternIntensity::make_workspace() const {
  auto workspace = std::make_unique<DifferenceWorkspace>();
  workspace->difference.resize(difference_.weights().size());
  return workspace;
}

}  // namespace af::registration
