// SPDX-License-Identifier: Apache-2.0
// Joins the builder's numerics with ranks and files: the phases of af-precompute, one function
// each.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "base/progress.h"
#include "io/field_file.h"
#include "parallel/communicator.h"
#include "precompute/codebook_training.h"
#include "precompute/field_caster.h"
#include "precompute/progress_files.h"

namespace af {

/// Asked between units; true ends casting with progress saved.
using StopRequested = std::function<bool()>;

struct CastPhase {
  std::vector<UnitTiles> mine;       ///< this rank's units
  std::uint64_t rays_cast = 0;       ///< over all ranks, without units of earlier runs
  std::uint64_t units_resumed = 0;   ///< over all ranks
  std::uint64_t occupied_tiles = 0;  ///< over all ranks
};

/// Collective. Casts every unit that `progress` (may be null) does not have, shared over the ranks
/// as they come free. StoppedError when `stop_requested` said so on any rank, with every finished
/// unit saved.
CastPhase cast_field(const FieldCaster& caster,
                     const std::vector<WorkUnit>& units,
                     ProgressFolder* progress,
                     const StopRequested& stop_requested,
                     const ProgressCallback& on_progress,
                     const Communicator& communicator);

/// Collective. The share of all tiles and the codebook trained on it.
TrainedCodebook train_field(const CastPhase& cast,
                            const std::vector<WorkUnit>& units,
                            const LightSlab& light_slab,
                            const TrainingSelection& selection,
                            const CodebookOptions& options,
                            const ProgressCallback& on_progress,
                            const Communicator& communicator);

struct EncodePhase {
  std::vector<IndexBlock> blocks;   ///< this rank's
  std::uint64_t squared_error = 0;  ///< over all ranks, in squared levels
};

/// Collective. Encodes this rank's units and frees their tiles.
EncodePhase encode_field(CastPhase& cast,
                         const std::vector<WorkUnit>& units,
                         const LightSlab& light_slab,
                         const Codebook& codebook,
                         const ProgressCallback& on_progress,
                         const Communicator& communicator);

/// Collective. Rank 0's geometry on every rank: sizing uses libm, whose last bit may differ between
/// processors.
LightSlab shared_light_slab(const LightSlab& light_slab, const Communicator& communicator);

}  // namespace af
