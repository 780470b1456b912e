// SPDX-License-Identifier: Apache-2.0
// Joins the builder's numerics with ranks and files: the phases of af-precompute, one function
// each.
#pragma once

#include <cstdint>
#include <functional>
#include <utility>
#include <vector>

#include "base/progress.h"
#include "field_file/field_file.h"
#include "parallel/communicator.h"
#include "precompute/casting/field_caster.h"
#include "precompute/codebook/codebook_training.h"
#include "precompute/codebook/nearest_codeword.h"
#include "precompute/pipeline/unit_store.h"

namespace af {

/// Asked between units; true ends casting with progress saved.
using StopRequested = std::function<bool()>;

/// What the phases work on. What it refers to must outlive them.
struct FieldBuild {
  const FieldCaster& caster;
  FieldLattice lattice;
  const std::vector<WorkUnit>& units;
  std::vector<double> unit_costs;  ///< relative, of casting each unit; empty: all alike
  UnitStore* progress = nullptr;   ///< may be null
  const Communicator& communicator;
};

/// Where the tiles are found, once the codebook is trained, that no rank has kept in memory.
enum class TileOverflow { ReadBack, CastAgain };

struct CastLimits {
  TrainingSelection selection;
  std::uint64_t kept_tile_bytes = ~std::uint64_t{0};  ///< of tiles kept in memory by each rank
};

struct CastPhase {
  explicit CastPhase(TrainingTilePicker tile_picker) : picker(std::move(tile_picker)) {}

  std::vector<UnitTiles> kept;            ///< this rank's units whose tiles fit into memory
  std::vector<std::uint32_t> let_go;      ///< this rank's others
  TrainingTilePicker picker;              ///< has seen all of this rank's units
  std::vector<std::uint64_t> unit_tiles;  ///< tiles that are not empty, of every unit
  std::uint64_t rays_cast = 0;            ///< over all ranks, without units of earlier runs
  std::uint64_t units_resumed = 0;        ///< over all ranks
  std::uint64_t units_kept = 0;           ///< over all ranks
  std::uint64_t occupied_tiles = 0;       ///< over all ranks
  std::vector<double> busy_seconds;       ///< of every rank: casting
  std::uint64_t occupied_tiles_cast = 0;  ///< over all ranks, without units of earlier runs
};

/// Collective. Casts every unit that the progress folder does not have, shared over the ranks as
/// they come free, the costly ones first. Keeps training candidates and as many tiles as fit.
/// StoppedError when `stop_requested` said so on any rank, with every finished unit saved.
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
/// past the file cache, and compares with how fast it cast them. Without a folder tiles are cast
/// again.
OverflowChoice choose_overflow(const FieldBuild& build, const CastPhase& cast);

/// Collective. The codebook trained on the share that the picker took of all tiles.
TrainedCodebook train_field(const FieldBuild& build,
                            CastPhase& cast,
                            const CodebookOptions& options,
                            const ProgressCallback& on_progress,
                            const TrainingCheckpoints& checkpoints = {});

/// Encodes units in rounds, for write_field(). Every rank encodes the tiles it has kept; the others
/// are dealt out such that all ranks have equally many.
class FieldEncoder {
 public:
  /// Collective. `cast` is emptied while encoding and must outlive the encoder.
  FieldEncoder(const FieldBuild& build,
               CastPhase& cast,
               const Codebook& codebook,
               TileOverflow overflow);

  /// This rank's next units, about kRoundBytes of indices; none when it has no more. Units that an
  /// earlier run encoded with the same codebook are read. StoppedError, with what is encoded saved,
  /// when `stop_requested` says so.
  std::vector<IndexBlock> next_blocks(const ProgressCallback& on_progress = {},
                                      const StopRequested& stop_requested = {});

  /// Collective. Over all ranks, in squared levels; once all blocks are made.
  [[nodiscard]] std::uint64_t squared_error() const;
  /// Collective. Seconds of every rank spent in next_blocks().
  [[nodiscard]] std::vector<double> busy_seconds() const;
  /// Units that were to be read back but were damaged, and cast again; this rank's.
  [[nodiscard]] std::uint64_t units_damaged() const { return units_damaged_; }
  /// Collective. Units that an earlier run had encoded, over all ranks.
  [[nodiscard]] std::uint64_t units_resumed() const;

  static constexpr std::size_t kRoundBytes = std::size_t{8} << 20;

 private:
  void deal_out_others();
  [[nodiscard]] UnitTiles tiles_again(const WorkUnit& unit);
  IndexBlock next_block();
  EncodedUnit encoded(const WorkUnit& unit, bool is_kept);

  const FieldBuild& build_;
  CastPhase& cast_;
  NearestCodeword search_;
  std::uint32_t codebook_crc_;
  TileOverflow overflow_;
  std::vector<std::uint32_t> others_;  ///< this rank's units that are not in memory
  double tiles_in_all_ = 0.0;
  double tiles_done_ = 0.0;
  double busy_seconds_ = 0.0;
  std::uint64_t squared_error_ = 0;
  std::uint64_t units_damaged_ = 0;
  std::uint64_t units_resumed_ = 0;
  std::vector<std::uint16_t> samples_;
};

}  // namespace af
