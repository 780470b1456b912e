// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "precompute/build/precompute_options.h"

namespace af {

/// Memory of one rank in each phase: upper bounds, from the plan alone. They include neither the CT
/// and its grid (once per node) nor tiles that are kept between casting and encoding.
struct MemoryPlan {
  std::uint64_t fixed_bytes = 0;     ///< program, libraries, MPI
  std::uint64_t casting_bytes = 0;   ///< one unit, and training candidates
  std::uint64_t training_bytes = 0;  ///< training tiles, codebook, sums
  std::uint64_t encoding_bytes = 0;  ///< codebook, one unit, one round of indices on its way

  /// What a rank needs even when it keeps no tiles.
  [[nodiscard]] std::uint64_t least_bytes() const;
  /// What is left for tiles under a limit.
  [[nodiscard]] std::uint64_t kept_tile_bytes(std::uint64_t limit_bytes) const;
};

/// `fixed_bytes`: what a rank takes before it casts.
MemoryPlan plan_memory(const FieldLattice& lattice,
                       const std::vector<WorkUnit>& units,
                       const PrecomputeOptions& options,
                       std::uint64_t fixed_bytes,
                       int ranks);

/// The limit that applies: the option's, or else the default raised to what a rank needs without
/// keeping any tiles. Throws InputError when the option's limit is below that need.
std::uint64_t memory_limit(const PrecomputeOptions& options, const MemoryPlan& plan);

/// Memory of this process as the system states it; 0 where it does not.
struct ProcessMemory {
  std::uint64_t own_bytes = 0;      ///< resident, private
  std::uint64_t program_bytes = 0;  ///< resident, files: the program and its libraries
  std::uint64_t shared_bytes = 0;   ///< resident, shared with other ranks of the node
  std::uint64_t peak_own_bytes =
      0;  ///< peak resident since forget_peak(), minus program and shared
};

ProcessMemory measured_memory();

/// Starts a new peak.
void forget_peak();

}  // namespace af
