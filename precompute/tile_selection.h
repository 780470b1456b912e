// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "field/tile.h"
#include "precompute/codebook_reduction.h"
#include "precompute/unit_tiles.h"

namespace af {

/// A tile of the field and its number over all slabs (TileLattice::global_index).
struct NumberedTile {
  std::int64_t global_index = 0;
  Tile tile{};
};

/// Tiles that a rank trains on, and tiles it only measures the codebook with.
struct TrainingShare {
  std::vector<NumberedTile> training;
  std::vector<NumberedTile> held_out;
};

struct TrainingSelection {
  double fraction = 0.10;                      ///< of the tiles that are not empty
  std::uint64_t max_training_tiles = 2000000;  ///< over all ranks
  std::uint64_t seed = 1;
};

std::vector<std::string> problems(const TrainingSelection& selection);

/// Collective. The share of this rank's units (`tiles[i]` belongs to `units[tiles[i].unit_id]`):
/// tile i trains when hash(seed, i) lies below a threshold, so that the choice depends on neither
/// ranks nor plan. The threshold is the fraction's, or the highest of 65536 steps that keeps the
/// number of training tiles of all ranks within the cap. An eighth as many again are held out.
/// Empty tiles take no part: they are codeword 0.
TrainingShare select_training_tiles(std::span<const UnitTiles> tiles,
                                    std::span<const WorkUnit> units,
                                    const LightSlab& light_slab,
                                    const TrainingSelection& selection,
                                    const CodebookReduction& reduction);

/// A tile with the key it is picked by.
struct KeyedTile {
  std::uint64_t key = 0;
  NumberedTile numbered;
};

/// Collective. The `count` tiles with the smallest keys over all ranks (ties: smallest global
/// index), sorted by (key, index), the same on every rank; all of them when there are fewer.
/// `keys[i]` belongs to `tiles[i]`. Only the tiles picked travel: the largest key is found by four
/// summed histograms.
std::vector<KeyedTile> smallest_keyed_tiles(std::span<const std::uint64_t> keys,
                                            std::span<const NumberedTile> tiles,
                                            std::uint64_t count,
                                            const CodebookReduction& reduction);

/// Key whose smallest values are a sample without replacement with probabilities proportional to
/// the square root of the tiles' AC norm (Efraimidis and Spirakis 2006: an exponential variate over
/// the weight). From correctly rounded operations only, hence the same bits everywhere.
std::uint64_t weighted_sampling_key(std::uint64_t seed, const NumberedTile& tile);

}  // namespace af
