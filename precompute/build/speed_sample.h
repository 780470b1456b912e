// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>

#include "precompute/build/precompute_options.h"
#include "precompute/casting/field_caster.h"

namespace af {

/// How fast one rank works on a field, from short samples of the work itself.
struct SpeedSample {
  double rays_per_second = 0.0;
  double occupied_fraction = 0.0;  ///< share of the field's tiles that are not empty
  double encode_seconds_per_tile =
      0.0;  ///< for tiles that are not empty; a neighbour's codeword as hint
  double train_seconds_per_tile = 0.0;  ///< and per iteration; the tile's own last codeword as hint
  double codebook_seconds = 0.0;        ///< to prepare a search
  double compress_seconds_per_byte = 0.0;  ///< for indices (and means) of tiles that are not empty
  double compressed_fraction = 1.0;        ///< for those indices
};

/// Casts units of a plan in pseudo-random order for about `seconds`, and codes some of their tiles
/// with others as codewords.
SpeedSample sample_speed(const FieldCaster& caster,
                         const FieldLattice& lattice,
                         const PlanOptions& plan,
                         const PrecomputeOptions& options,
                         double seconds);

/// How fast the disk of a folder is, measured with a nameless file of 16 MiB.
struct DiskSample {
  double write_bytes_per_second = 0.0;  ///< to the disk itself
  double read_bytes_per_second = 0.0;   ///< past the system's cache, if it lets go
  std::uint64_t available_bytes = 0;    ///< left for new files
};

/// Both speeds are 0 when nothing can be written there.
DiskSample sample_disk(const std::filesystem::path& folder);

}  // namespace af
