// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "precompute/casting/field_caster.h"
#include "precompute/casting/unit_tiles.h"
#include "precompute/design/probe_rays.h"

namespace af {

/// Chunks of a field file as they will be cast, from a few viewpoints of every slab.
struct FieldSample {
  struct Chunk {
    WorkUnit unit;
    UnitTiles tiles;
  };
  std::vector<Chunk> chunks;           ///< this rank's
  std::vector<double> occupied_share;  ///< one per chunk over all ranks; only this rank's are set
  std::vector<double>
      tiles_meant;  ///< tiles of the field that each chunk represents, over all ranks
};

/// Casts whole (s,t) planes from `viewpoints` 2 x 2 blocks of viewpoints, evenly spread over the
/// (u,v) plane, chunk by chunk. A rank casts its share of chunks.
FieldSample sample_field(const FieldCaster& caster,
                         const FieldLattice& lattice,
                         int viewpoints,
                         const ProbeShare& share);

}  // namespace af
