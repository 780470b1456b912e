// SPDX-License-Identifier: Apache-2.0
#include "precompute/codebook/mean_removal.h"

#include <algorithm>

#include "base/error.h"

namespace af {

MeanRemovedTile remove_mean(const Tile& tile, int mean_step) {
  check(mean_step >= 1 && mean_step <= kMaxMeanStep, "a step of means");
  const auto step = static_cast<std::uint32_t>(mean_step);
  constexpr auto kElements = static_cast<std::uint32_t>(kTileElements);
  const std::uint32_t steps = (tile_sum(tile) + kElements * step / 2) / (kElements * step);
  const std::uint32_t mean = std::min(steps, 65535u / step) * step;
  MeanRemovedTile removed;
  removed.mean = static_cast<std::uint16_t>(mean);
  for (std::size_t i = 0; i < kTileElements; ++i)
    removed.shape[i] = static_cast<std::uint16_t>(
        std::clamp(int{tile[i]} - static_cast<int>(mean) + kShapeZero, 0, 65535));
  removed.shape = folded_shape(removed.shape);
  return removed;
}

void remove_means(std::span<NumberedTile> tiles, int mean_step) {
  if (mean_step == 0) return;
  for (NumberedTile& tile : tiles) tile.tile = remove_mean(tile.tile, mean_step).shape;
}

void remove_means(TrainingShare& share, int mean_step) {
  remove_means(std::span(share.training), mean_step);
  remove_means(std::span(share.held_out), mean_step);
}

}  // namespace af
