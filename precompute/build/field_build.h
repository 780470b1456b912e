// SPDX-License-Identifier: Apache-2.0
// Joins the builder's numerics with ranks and files: casting and training, and how tiles that were
// not kept come back. For encoding see FieldEncoder.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "base/progress.h"
#include "precompute/build/unit_store.h"
#include "precompute/casting/field_caster.h"
#include "precompute/codebook/codebook_training.h"
#include "precompute/codebook/filter_fitting.h"
#include "ranks/communicator.h"

namespace af {

/// How the ranks of a communicator, which must outlive it, combine their results.
inline CodebookReduction reduction_over(const Communicator& communicator) {
  return {
      [&communicator](std::span<std::uint64_t> values) { communicator.sum(values); },
      [&communicator](std::span<const std::byte> mine) { return communicator.all_gather(mine); },
      static_cast<std::size_t>(communicator.rank())};
}

/// Asked between units. true ends casting with progress saved.
using StopRequested = std::function<bool()>;

/// What the phases work on. Whatever it refers to must outlive them.
struct FieldBuild {
  const FieldCaster& caster;
  FieldLattice lattice;
  const std::vector<WorkUnit>& units;
  std::vector<double> unit_costs;  ///< relative cost of casting each unit; empty: all alike
  UnitStore* progress = nullptr;   ///< may be null
  const Communicator& communicator;
};

/// Where the tiles that no rank kept in memory come from after training.
enum class TileOverflow { ReadBack, CastAgain };

struct CastLimits {
  TrainingSelection selection;
  std::uint64_t kept_tile_bytes = ~std::uint64_t{0};  ///< tiles that each rank keeps in memory
};

struct CastPhase {
  explicit CastPhase(TrainingTilePicker tile_picker) : picker(std::move(tile_picker)) {}

  std::vector<UnitTiles> kept;                ///< this rank's units whose tiles fit into memory
  std::vector<std::uint32_t> dropped;         ///< this rank's units whose tiles did not fit
  TrainingTilePicker picker;                  ///< has seen all of this rank's units
  std::vector<std::uint64_t> tiles_per_unit;  ///< tiles of every unit that are not empty
  std::uint64_t rays_cast = 0;                ///< over all ranks, except for units of earlier runs
  std::uint64_t units_resumed = 0;            ///< over all ranks
  std::uint64_t units_kept = 0;               ///< over all ranks
  std::uint64_t occupied_tiles = 0;           ///< over all ranks
  std::vector<double> busy_seconds;           ///< casting, one value per rank
  std::uint64_t occupied_tiles_cast = 0;      ///< over all ranks, except for units of earlier runs
};

/// Collective. Casts every unit that the progress folder does not have, shared over the ranks as
/// they become free, the costly ones first. Keeps training candidates, and as many tiles as fit.
/// Throws StoppedError when `stop_requested` said so on any rank, with every finished unit saved.
CastPhase cast_field(const FieldBuild& build,
                     const CastLimits& limits,
                     const StopRequested& stop_requested,
                     const ProgressCallback& on_progress);

/// How the tiles that were not kept come back, and why.
struct OverflowChoice {
  TileOverflow overflow = TileOverflow::CastAgain;
  double read_bytes_per_second = 0.0;  ///< of one rank while all read; 0: not measured
  double cast_bytes_per_second = 0.0;  ///< tile bytes that one rank casts; 0: not measured
};

/// Collective. Measures how fast every rank reads some of its units back from the progress folder,
/// past the file cache, and compares that with how fast it cast them. Without a folder, tiles are
/// cast again.
OverflowChoice choose_overflow(const FieldBuild& build, const CastPhase& cast);

/// Collective. Trains the codebook on the picker's share of all tiles, or on their shapes if the
/// options have a mean step.
TrainedCodebook train_field(const FieldBuild& build,
                            CastPhase& cast,
                            const CodebookOptions& options,
                            const ProgressCallback& on_progress,
                            const TrainingCheckpoints& checkpoints = {});

/// Collective. Casts the patches of filter_patches(), shared over the ranks, and fits the filter of
/// the codebook's tiles to them. The result is the same on any number of ranks.
FittedFilter fit_filter(const FieldBuild& build, const Codebook& codebook, std::uint64_t seed);

}  // namespace af
