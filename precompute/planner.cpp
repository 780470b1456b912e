// SPDX-License-Identifier: Apache-2.0
#include "precompute/planner.h"

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
};

UnitExtent unit_extent(const LightSlab& light_slab,
                       const SlabGeometry& slab,
                       const PlanOptions& options) {
  const std::int64_t rows = slab.stored_s.count;
  const std::int64_t rays_of_row = slab.stored_t.count;
  const std::int64_t viewpoints = std::max<std::int64_t>(
      4, options.rays_per_unit / std::max<std::int64_t>(1, rows * rays_of_row));
  UnitExtent extent;
  extent.u = std::min(round_up_to_even(light_slab.u.nodes), round_up_to_even(viewpoints / 2));
  extent.v = std::clamp(
      static_cast<int>(viewpoints / extent.u) / 2 * 2, 2, round_up_to_even(light_slab.v.nodes));
  const std::int64_t rows_of_unit =
      options.rays_per_unit / (std::int64_t{extent.u} * extent.v * rays_of_row);
  extent.s = static_cast<int>(
      std::clamp<std::int64_t>(rows_of_unit / 2 * 2, 2, std::max(2, round_up_to_even(rows))));
  return extent;
}

}  // namespace

TileLattice::TileLattice(const LightSlab& light_slab, std::size_t slab) {
  const auto counts_of = [&](const SlabGeometry& geometry) {
    return std::array<std::int64_t, 4>{(light_slab.u.nodes + 1) / 2,
                                       (light_slab.v.nodes + 1) / 2,
                                       geometry.stored_s.tiles(),
                                       geometry.stored_t.tiles()};
  };
  for (std::size_t k = 0; k < slab; ++k) {
    const auto before = counts_of(light_slab.slabs[k]);
    first_global_index += before[0] * before[1] * before[2] * before[3];
  }
  counts = counts_of(light_slab.slabs[slab]);
}

std::int64_t TileLattice::global_index(const WorkUnit& unit,
                                       const LightSlab& light_slab,
                                       std::size_t local_tile) const {
  const auto of_unit = unit.tile_counts();
  auto rest = static_cast<std::int64_t>(local_tile);
  const std::int64_t d = rest % of_unit[3];
  rest /= of_unit[3];
  const std::int64_t c = rest % of_unit[2];
  rest /= of_unit[2];
  const std::int64_t b = rest % of_unit[1];
  const std::int64_t a = rest / of_unit[1];
  const NodeRange& stored_s = light_slab.slabs[unit.slab].stored_s;
  const std::int64_t uv = (unit.u.begin / 2 + a) * counts[1] + unit.v.begin / 2 + b;
  const std::int64_t s = (unit.s.begin - stored_s.begin) / 2 + c;
  return first_global_index + (uv * counts[2] + s) * counts[3] + d;
}

std::vector<std::string> problems(const PlanOptions& options) {
  if (options.rays_per_unit >= 1) return {};
  return {"rays_per_unit = " + std::to_string(options.rays_per_unit) + ": must be at least 1"};
}

std::vector<WorkUnit> plan_units(const LightSlab& light_slab, const PlanOptions& options) {
  std::vector<WorkUnit> units;
  for (std::size_t k = 0; k < light_slab.slabs.size(); ++k) {
    const SlabGeometry& slab = light_slab.slabs[k];
    const UnitExtent extent = unit_extent(light_slab, slab, options);
    for (const NodeRange& u : pieces_of({0, light_slab.u.nodes}, extent.u))
      for (const NodeRange& v : pieces_of({0, light_slab.v.nodes}, extent.v))
        for (const NodeRange& s : pieces_of(slab.stored_s, extent.s))
          units.push_back({static_cast<std::uint32_t>(units.size()), k, u, v, s, slab.stored_t});
  }
  return units;
}

PlanOptions plan_options_for_ranks(const LightSlab& light_slab,
                                   int ranks,
                                   const PlanOptions& largest) {
  constexpr std::int64_t kUnitsPerRank = 16;
  const std::int64_t share = stored_ray_count(light_slab) / (kUnitsPerRank * ranks);
  return {std::clamp<std::int64_t>(share, 1, largest.rays_per_unit)};
}

std::int64_t stored_ray_count(const LightSlab& light_slab) {
  std::int64_t rays = 0;
  for (const SlabGeometry& slab : light_slab.slabs)
    rays += std::int64_t{slab.stored_s.count} * slab.stored_t.count;
  return rays * light_slab.u.nodes * light_slab.v.nodes;
}

std::int64_t stored_tile_count(const LightSlab& light_slab) {
  std::int64_t tiles = 0;
  for (std::size_t k = 0; k < light_slab.slabs.size(); ++k)
    tiles += TileLattice(light_slab, k).tile_count();
  return tiles;
}

}  // namespace af
