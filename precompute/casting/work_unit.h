// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>

#include "geometry/field_lattice.h"

namespace af {

/// Units begin at multiples of this along t, counted from the slab's first stored node, because
/// casters work on such runs.
inline constexpr int kRunOfT = 32;

/// The unit of work and of restart: one slab x an even-aligned rectangle of viewpoints x an
/// even-aligned rectangle of the slab's stored nodes. Every tile is complete within one unit, so no
/// samples cross ranks and the payload does not depend on the plan.
struct WorkUnit {
  std::uint32_t id = 0;  ///< position in the plan
  std::size_t slab = 0;
  NodeRange u;  ///< lattice nodes within what the slab stores
  NodeRange v;
  NodeRange s;
  NodeRange t;

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

/// "unit 3 of 32 (slab 0, viewpoints u 0 to 7, v 2 to 3)".
std::string name_of(const WorkUnit& unit, std::size_t units);

/// Where a unit's tiles lie in the field.
class TilePlaces {
 public:
  TilePlaces(const FieldLattice& lattice, const WorkUnit& unit);

  /// The unit's first tile in the slab's [Tu][Tv][Ts][Tt] array.
  [[nodiscard]] const std::array<int, 4>& first() const { return first_; }
  /// Number of a tile over all slabs. `local_tile` counts within the unit, [u][v][s][t]. Random
  /// choices are keyed by it.
  [[nodiscard]] std::int64_t global_index(std::size_t local_tile) const;

 private:
  std::int64_t tiles_before_slab_;
  std::array<int, 4> counts_of_slab_;
  std::array<int, 4> counts_of_unit_;
  std::array<int, 4> first_{};
};

}  // namespace af
