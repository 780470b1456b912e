// SPDX-License-Identifier: Apache-2.0
#include "precompute/casting/work_unit.h"

namespace af {

std::string name_of(const WorkUnit& unit, std::size_t units) {
  const auto range = [](const NodeRange& nodes) {
    return std::to_string(nodes.begin) + " to " + std::to_string(nodes.end() - 1);
  };
  return "unit " + std::to_string(unit.id) + " of " + std::to_string(units) + " (slab " +
         std::to_string(unit.slab) + ", viewpoints u " + range(unit.u) + ", v " + range(unit.v) +
         ")";
}

TilePlaces::TilePlaces(const FieldLattice& lattice, const WorkUnit& unit)
    : tiles_before_slab_(lattice.tiles_before(unit.slab)),
      counts_of_slab_(lattice.slabs[unit.slab].tile_counts()),
      counts_of_unit_(unit.tile_counts()) {
  const std::array<int, 4> begin = {unit.u.begin, unit.v.begin, unit.s.begin, unit.t.begin};
  const std::array<LatticeAxis, 4> axes = lattice.slabs[unit.slab].axes();
  for (std::size_t axis = 0; axis < 4; ++axis)
    first_[axis] = (begin[axis] - axes[axis].stored.begin) / 2;
}

std::int64_t TilePlaces::global_index(std::size_t local_tile) const {
  std::int64_t index = tiles_before_slab_;
  std::int64_t stride = 1;
  auto rest = static_cast<std::int64_t>(local_tile);
  for (std::size_t axis = 4; axis-- > 0;) {
    index += (first_[axis] + rest % counts_of_unit_[axis]) * stride;
    rest /= counts_of_unit_[axis];
    stride *= counts_of_slab_[axis];
  }
  return index;
}

}  // namespace af
