// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "geometry/light_slab.h"

namespace af {

/// Units begin at multiples of this along t, counted from the slab's first stored node: casters
/// work on such runs.
inline constexpr int kRunOfT = 32;

/// The unit of work and of restart: one slab x an even-aligned rectangle of viewpoints x an
/// even-aligned rectangle of the slab's stored nodes. Every tile is complete within one unit, so no
/// samples cross ranks and the payload does not depend on the plan.
struct WorkUnit {
  std::uint32_t id = 0;  ///< position in the plan
  std::size_t slab = 0;
  NodeRange u;  ///< of LightSlab::u
  NodeRange v;
  NodeRange s;  ///< lattice nodes within the slab's stored_s
  NodeRange t;  ///< within stored_t

  /// Samples [u][v][s][t], t fastest.
  [[nodiscard]] std::size_t sample_count() const {
    return static_cast<std::size_t>(u.count) * static_cast<std::size_t>(v.count) *
           static_cast<std::size_t>(s.count) * static_cast<std::size_t>(t.count);
  }
  [[nodiscard]] std::array<int, 4> tile_counts() const {
    return {u.tiles(), v.tiles(), s.tiles(), t.tiles()};
  }
  [[nodiscard]] std::size_t tile_count() const {
    return static_cast<std::size_t>(u.tiles()) * static_cast<std::size_t>(v.tiles()) *
           static_cast<std::size_t>(s.tiles()) * static_cast<std::size_t>(t.tiles());
  }
};

/// Where the tiles of a slab stand: position of tile (a, b, c, d) in the slab's [Tu][Tv][Ts][Tt]
/// array.
struct TileLattice {
  std::array<std::int64_t, 4> counts = {0, 0, 0, 0};
  std::int64_t first_global_index = 0;  ///< tiles of all slabs before this one

  TileLattice(const LightSlab& light_slab, std::size_t slab);
  [[nodiscard]] std::int64_t tile_count() const {
    return counts[0] * counts[1] * counts[2] * counts[3];
  }
  /// Number of a unit's tile over all slabs; `local_tile` counts within the unit, [u][v][s][t].
  /// Random choices are keyed by it.
  [[nodiscard]] std::int64_t global_index(const WorkUnit& unit,
                                          const LightSlab& light_slab,
                                          std::size_t local_tile) const;
};

}  // namespace af
