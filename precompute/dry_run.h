// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "precompute/build/field_build.h"
#include "precompute/build/memory_plan.h"
#include "precompute/build/precompute_options.h"
#include "precompute/build/speed_sample.h"
#include "precompute/field_parts.h"
#include "precompute/phase_clock.h"

namespace af {

/// What a forecast is made from.
struct DryRun {
  const FieldSource& source;
  const std::vector<FieldPart>& parts;
  const FieldLattice& lattice;
  const PrecomputeOptions& options;
  std::vector<WorkUnit> units;
  std::uint64_t volume_bytes = 0;  ///< of the CT and its resampled grid, once per node
  SpeedSample speed;               ///< of one rank
  DiskSample disk;                 ///< of the folder that holds unfinished work
  MemoryPlan memory;
  PhaseSeconds past;  ///< phases that a dry run goes through itself: reading and resampling
  int ranks = 1;
};

/// What the field would need.
struct FieldForecast {
  std::uint64_t uncropped_bytes = 0;                ///< all nodes of the lattice at 16 bits
  std::uint64_t cropped_bytes = 0;                  ///< stored nodes at 16 bits
  std::uint64_t payload_bytes = 0;                  ///< indices and codebook
  std::uint64_t file_bytes = 0;                     ///< about: empty tiles compress away
  std::uint64_t tile_bytes = 0;                     ///< of tiles that are not empty, over all ranks
  std::uint64_t kept_bytes = 0;                     ///< of them in memory
  TileOverflow overflow = TileOverflow::CastAgain;  ///< of the rest
  std::uint64_t limit_bytes = 0;                    ///< of memory, per rank
  std::uint64_t bytes_per_rank = 0;
  PhaseSeconds seconds;

  [[nodiscard]] double all_seconds() const;
};

FieldForecast forecast(const DryRun& run);

/// The text of --dry-run: sizes, units, memory, ratios, time, advice.
std::string dry_run_text(const DryRun& run);

}  // namespace af
