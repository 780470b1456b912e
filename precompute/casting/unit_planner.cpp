// SPDX-License-Identifier: Apache-2.0
#include "precompute/casting/unit_planner.h"

#include <algorithm>

namespace af {

namespace {

int round_up_to_even(std::int64_t value) {
  return static_cast<int>((value + 1) / 2 * 2);
}

/// Even-aligned pieces of `whole`, each of `size` nodes but the last.
std::vector<NodeRange> pieces_of(const NodeRange& whole, int size) {
  std::vector<NodeRange> pieces;
  for (int begin = whole.begin; begin < whole.end(); begin += size)
    pieces.push_back({begin, std::min(size, whole.end() - begin)});
  return pieces;
}

struct UnitExtent {
  int u = 2;
  int v = 2;
  int s = 2;
  int t = 2;

  [[nodiscard]] std::int64_t rays() const { return std::int64_t{u} * v * s * t; }
};

/// Halves `size`, to multiples of `step`, while the unit has too many rays.
void halve_while_too_large(UnitExtent& extent, int& size, int step, std::int64_t rays) {
  while (extent.rays() > rays && size > step) size = (size / 2 + step - 1) / step * step;
}

UnitExtent unit_extent(const SlabLattice& slab, const PlanOptions& options) {
  const int all_v = round_up_to_even(slab.v.stored.count);
  UnitExtent extent;
  extent.u = round_up_to_even(slab.u.stored.count);
  extent.s = std::min(round_up_to_even(slab.s.stored.count), kLargestS);
  extent.t = std::min((slab.t.stored.count + kRunOfT - 1) / kRunOfT * kRunOfT, kLargestT);
  while (extent.v < all_v && 2 * extent.rays() <= options.rays_per_unit)
    extent.v = std::min(2 * extent.v, all_v);
  for (int* size : {&extent.t, &extent.s})
    halve_while_too_large(extent, *size, kRunOfT, options.rays_per_unit);
  for (int* size : {&extent.u, &extent.s})
    halve_while_too_large(extent, *size, 2, options.rays_per_unit);
  return extent;
}

}  // namespace

std::vector<WorkUnit> plan_units(const FieldLattice& lattice, const PlanOptions& options) {
  std::vector<WorkUnit> units;
  for (std::size_t k = 0; k < lattice.slabs.size(); ++k) {
    const SlabLattice& slab = lattice.slabs[k];
    const UnitExtent extent = unit_extent(slab, options);
    for (const NodeRange& u : pieces_of(slab.u.stored, extent.u))
      for (const NodeRange& v : pieces_of(slab.v.stored, extent.v))
        for (const NodeRange& s : pieces_of(slab.s.stored, extent.s))
          for (const NodeRange& t : pieces_of(slab.t.stored, extent.t))
            units.push_back({static_cast<std::uint32_t>(units.size()), k, u, v, s, t});
  }
  return units;
}

PlanOptions plan_options_for_ranks(const FieldLattice& lattice,
                                   int ranks,
                                   const PlanOptions& largest) {
  constexpr std::int64_t kUnitsPerRank = 16;
  const std::int64_t share = lattice.stored_node_count() / (kUnitsPerRank * ranks);
  return {std::clamp<std::int64_t>(share, 1, largest.rays_per_unit)};
}

}  // namespace af
