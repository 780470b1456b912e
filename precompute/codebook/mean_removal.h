// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>

#include "field/codebook.h"
#include "precompute/codebook/nearest_codeword.h"
#include "precompute/codebook/tile_selection.h"

namespace af {

/// A tile as its mean, rounded to a multiple of the step, and its shape: what is left, kShapeZero
/// higher and folded (folded_shape()), so that shapes can be trained and searched as plain tiles
/// are.
struct MeanRemovedTile {
  std::uint16_t mean = 0;  ///< levels
  Tile shape{};
};

/// `mean_step`: 1 ... kMaxMeanStep levels.
MeanRemovedTile remove_mean(const Tile& tile, int mean_step);

/// In place, tiles to shapes; nothing when `mean_step` is 0.
void remove_means(std::span<NumberedTile> tiles, int mean_step);
void remove_means(TrainingShare& share, int mean_step);

/// The search that is fast for plain tiles, or for folded shapes where `mean_step` is above 0.
NearestCodeword codeword_search(const Codebook& trained, int mean_step);

/// The codebook of a field from one that was trained, on shapes where `mean_step` is above 0.
Codebook field_codebook(const Codebook& trained, int mean_step);

}  // namespace af
