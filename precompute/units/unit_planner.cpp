// SPDX-License-Identifier: Apache-2.0
#include "precompute/units/unit_planner.h"

#include <algorithm>

#include <Eigen/Geometry>

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

UnitExtent unit_extent(const LightSlab& light_slab,
                       const SlabGeometry& slab,
                       const PlanOptions& options) {
  const int all_v = round_up_to_even(light_slab.v.nodes);
  UnitExtent extent;
  extent.u = round_up_to_even(light_slab.u.nodes);
  extent.s = std::min(round_up_to_even(slab.stored_s.count), kLargestS);
  extent.t = std::min((slab.stored_t.count + kRunOfT - 1) / kRunOfT * kRunOfT, kLargestT);
  while (extent.v < all_v && 2 * extent.rays() <= options.rays_per_unit)
    extent.v = std::min(2 * extent.v, all_v);
  for (int* size : {&extent.t, &extent.s})
    halve_while_too_large(extent, *size, kRunOfT, options.rays_per_unit);
  for (int* size : {&extent.u, &extent.s})
    halve_while_too_large(extent, *size, 2, options.rays_per_unit);
  return extent;
}

/// The part of nodes [range.begin, range.end()) that lies in [low, high].
double covered_fraction(const NodeRange& range, double low, double high) {
  const double covered = std::min<double>(high, range.end()) - std::max<double>(low, range.begin);
  return std::clamp(covered / range.count, 0.0, 1.0);
}

/// The part of a unit's nodes that the box's shadow, as seen from one viewpoint, covers.
double shadow_fraction(const WorkUnit& unit,
                       const SlabGeometry& slab,
                       const Eigen::Vector3d& viewpoint,
                       const Eigen::AlignedBox3d& box) {
  Eigen::AlignedBox2d nodes;
  for (const double x : {box.min().x(), box.max().x()})
    for (const double y : {box.min().y(), box.max().y()})
      for (const double z : {box.min().z(), box.max().z()}) {
        const double scale = (slab.st_plane_y_mm - viewpoint.y()) / (y - viewpoint.y());
        const Eigen::Vector3d hit = viewpoint + scale * (Eigen::Vector3d(x, y, z) - viewpoint);
        nodes.extend(
            Eigen::Vector2d(slab.s.node_coordinate(hit.x()), slab.t.node_coordinate(hit.z())));
      }
  return covered_fraction(unit.s, nodes.min().x(), nodes.max().x()) *
         covered_fraction(unit.t, nodes.min().y(), nodes.max().y());
}

double unit_cost(const WorkUnit& unit,
                 const LightSlab& light_slab,
                 const Eigen::AlignedBox3d& all) {
  const SlabGeometry& slab = light_slab.slabs[unit.slab];
  Eigen::AlignedBox3d box = all;
  box.min().y() = std::max(box.min().y(), slab.y_low_mm);
  box.max().y() = std::min(box.max().y(), slab.y_high_mm);
  double covered = 0.0;
  for (const int u : {unit.u.begin, unit.u.begin + unit.u.count / 2, unit.u.end() - 1})
    for (const int v : {unit.v.begin, unit.v.end() - 1})
      covered += shadow_fraction(unit, slab, light_slab.viewpoint(u, v), box) / 6.0;
  const double depth = std::max(0.0, box.sizes().y()) / all.sizes().y();
  constexpr double kCostOfEmptyRay = 0.05;
  return static_cast<double>(unit.sample_count()) * (kCostOfEmptyRay + covered * depth);
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
  const SlabGeometry& slab = light_slab.slabs[unit.slab];
  const std::int64_t uv = (unit.u.begin / 2 + a) * counts[1] + unit.v.begin / 2 + b;
  const std::int64_t s = (unit.s.begin - slab.stored_s.begin) / 2 + c;
  const std::int64_t t = (unit.t.begin - slab.stored_t.begin) / 2 + d;
  return first_global_index + (uv * counts[2] + s) * counts[3] + t;
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
          for (const NodeRange& t : pieces_of(slab.stored_t, extent.t))
            units.push_back({static_cast<std::uint32_t>(units.size()), k, u, v, s, t});
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

std::vector<double> unit_costs(const std::vector<WorkUnit>& units,
                               const LightSlab& light_slab,
                               const std::array<Eigen::Vector3d, 8>& attenuating_corners_ct) {
  Eigen::AlignedBox3d box;
  for (const Eigen::Vector3d& corner : attenuating_corners_ct)
    box.extend(light_slab.slab_from_ct * corner);
  std::vector<double> costs;
  costs.reserve(units.size());
  for (const WorkUnit& unit : units) costs.push_back(unit_cost(unit, light_slab, box));
  return costs;
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
