// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "field/tile.h"
#include "precompute/casting/unit_tiles.h"
#include "precompute/codebook/codebook_reduction.h"

namespace af {

/// A tile of the field and its number over all slabs (TilePlaces::global_index).
struct NumberedTile {
  std::int64_t global_index = 0;
  Tile tile{};
};

/// Tiles on which a rank trains, and tiles on which it only measures the codebook.
struct TrainingShare {
  std::vector<NumberedTile> training;
  std::vector<NumberedTile> held_out;
};

/// Largest share of tiles used for training. An eighth of that number is held out in addition.
inline constexpr double kLargestTrainingFraction = 8.0 / 9.0;

struct TrainingSelection {
  double fraction = kLargestTrainingFraction;  ///< share of the tiles that are not empty
  std::uint64_t max_training_tiles = 2000000;  ///< over all ranks
  std::uint64_t seed = 1;
};

std::vector<std::string> problems(const TrainingSelection& selection);

/// Picks a rank's training tiles while units are cast, so that it need not keep the others. Tile i
/// trains when hash(seed, i) lies below a threshold, so the choice depends on neither ranks nor
/// plan. The threshold follows from the fraction, or is the highest of 65536 steps that keeps the
/// training tiles of all ranks within the cap. An eighth of their number is held out in addition.
/// Empty tiles are ignored, because they are codeword 0. The picker never holds many more
/// candidates than five quarters of the cap.
/// \test TileSelection.*
class TrainingTilePicker {
 public:
  TrainingTilePicker(const TrainingSelection& selection, const FieldLattice& lattice);

  void add(const UnitTiles& tiles, const WorkUnit& unit);

  /// Collective. Returns this rank's equal share of the tiles picked on all ranks, and empties the
  /// picker.
  [[nodiscard]] TrainingShare take(const CodebookReduction& reduction);

 private:
  void set_threshold(std::uint64_t last_training);
  void keep_within_cap();
  void drop_beyond();
  [[nodiscard]] std::uint64_t hash_of(const NumberedTile& tile) const;

  TrainingSelection selection_;
  FieldLattice lattice_;
  std::uint64_t last_training_ =
      0;  ///< largest hash that trains, by the fraction or this rank's cap
  std::uint64_t held_out_above_ = 0;      ///< no hash up to it is held out
  std::vector<std::uint64_t> histogram_;  ///< of the hashes up to last_training_, by bin
  TrainingShare candidates_;
};

}  // namespace af
