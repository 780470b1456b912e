// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>

#include "field/codebook.h"
#include "precompute/codebook/tile_selection.h"

namespace af {

/// A tile as its mean, rounded to a multiple of the step, and its shape. The shape is what is left,
/// kShapeZero higher and folded (folded_shape()), so that shapes can be trained and searched like
/// plain tiles.
struct MeanRemovedTile {
  std::uint16_t mean = 0;  ///< levels
  Tile shape{};
};

/// `mean_step`: 1 ... kMaxMeanStep levels.
MeanRemovedTile remove_mean(const Tile& tile, int mean_step);

/// Turns tiles into shapes in place. Does nothing when `mean_step` is 0.
void remove_means(std::span<NumberedTile> tiles, int mean_step);
void remove_means(TrainingShare& share, int mean_step);

}  // namespace af
