// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "geometry/light_slab.h"
#include "precompute/field_caster.h"
#include "precompute/precompute_options.h"
#include "precompute/source_loading.h"

namespace af {

/// Speed and occupancy of a field, from casting a spread sample of it.
struct CastSample {
  double rays_per_second = 0.0;
  double occupied_fraction = 0.0;  ///< of its tiles
};

/// Casts units of a plan in pseudo-random order for about `seconds`.
CastSample measure_casting(const FieldCaster& caster,
                           const LightSlab& light_slab,
                           const PlanOptions& plan,
                           double seconds);

/// What the field would need.
struct FieldForecast {
  std::uint64_t uncropped_bytes = 0;  ///< all nodes of the lattice at 16 bits
  std::uint64_t cropped_bytes = 0;    ///< stored nodes at 16 bits
  std::uint64_t payload_bytes = 0;    ///< indices and codebook
  std::uint64_t file_bytes = 0;       ///< about: empty tiles compress away
  std::uint64_t ct_bytes_per_node = 0;
  std::uint64_t bytes_per_rank = 0;
  double seconds = 0.0;
};

/// `volume_bytes`: what the CT and its resampled grid take on each node.
FieldForecast forecast(const LightSlab& light_slab,
                       const PrecomputeOptions& options,
                       std::uint64_t volume_bytes,
                       const CastSample& sample,
                       int ranks);

/// The text of --dry-run: sizes, units, memory, ratios, time, advice.
std::string dry_run_text(const FieldSource& source,
                         const LightSlab& light_slab,
                         const PrecomputeOptions& options,
                         const PlanOptions& plan,
                         std::uint64_t volume_bytes,
                         const CastSample& sample,
                         int ranks);

/// "12.3 MB" (10^6 bytes).
std::string megabytes_text(std::uint64_t bytes);

}  // namespace af
