// SPDX-License-Identifier: Apache-2.0
#include "precompute/casting/least_squares_caster.h"

#include <algorithm>
#include <limits>
#include <string>
#include <vector>

#include "base/error.h"

namespace af {

namespace {

/// The places midway between the nodes of an axis.
GridAxis midway(const GridAxis& axis, const char* name) {
  if (axis.nodes < kFewestFittedViewpoints)
    throw InputError(std::string(name) + " nodes of a field with least-squares viewpoints",
                     std::to_string(axis.nodes),
                     "must be at least " + std::to_string(kFewestFittedViewpoints));
  const double half_mm = 0.5 * axis.spacing_mm();
  return {axis.first_mm + half_mm, axis.last_mm - half_mm, axis.nodes - 1};
}

/// The range and its neighbours on both sides, within all nodes.
NodeRange with_neighbours(const NodeRange& range, const NodeRange& all) {
  const int begin = std::max(all.begin, range.begin - 1);
  return {begin, std::min(all.end(), range.end() + 1) - begin};
}

/// The cells between the nodes of a range.
NodeRange cells_of(const NodeRange& nodes) {
  return {nodes.begin, nodes.count - 1};
}

/// Line integrals of a unit's (s,t) nodes at a rectangle of viewpoints.
class CastSamples {
 public:
  CastSamples(const FieldCaster& caster,
              const WorkUnit& unit,
              const NodeRange& u,
              const NodeRange& v)
      : unit_(unit) {
    unit_.u = u;
    unit_.v = v;
    samples_.resize(unit_.sample_count());
    caster.cast(unit_, samples_);
  }

  /// Samples of one viewpoint, [s][t].
  [[nodiscard]] const std::uint16_t* at(int u, int v) const {
    const std::size_t viewpoint =
        static_cast<std::size_t>(u - unit_.u.begin) * static_cast<std::size_t>(unit_.v.count) +
        static_cast<std::size_t>(v - unit_.v.begin);
    return samples_.data() + viewpoint * per_viewpoint();
  }
  [[nodiscard]] std::size_t per_viewpoint() const {
    return static_cast<std::size_t>(unit_.s.count) * static_cast<std::size_t>(unit_.t.count);
  }

 private:
  WorkUnit unit_;
  std::vector<std::uint16_t> samples_;
};

/// Line integrals of a neighbouring viewpoint, and of the place midway to it.
struct Cell {
  const std::uint16_t* halfway;
  const std::uint16_t* neighbour;
};

/// The cells beside a viewpoint along one axis. A single one counts as both.
struct Cells {
  Cell before;
  Cell after;
};

template <typename CellTo>
Cells cells_beside(int node, const NodeRange& all, const CellTo& cell_to) {
  const bool has_before = node > all.begin;
  const bool has_after = node + 1 < all.end();
  return {cell_to(has_before ? node - 1 : node + 1), cell_to(has_after ? node + 1 : node - 1)};
}

/// Six times what the lines of both cells add to the viewpoint's own line integral.
std::int32_t six_changes(const Cells& cells, std::int32_t own, std::size_t i) {
  const std::int32_t halfway = cells.before.halfway[i] + cells.after.halfway[i];
  const std::int32_t neighbours = cells.before.neighbour[i] + cells.after.neighbour[i];
  return 2 * (halfway - own) - neighbours;
}

}  // namespace

LeastSquaresFieldCaster::LeastSquaresFieldCaster(const LightSlab& light_slab,
                                                 const MakeCaster& make_caster)
    : u_nodes_{0, light_slab.u.nodes},
      v_nodes_{0, light_slab.v.nodes},
      between_u_(light_slab),
      between_v_(light_slab) {
  between_u_.u = midway(light_slab.u, "u");
  between_v_.v = midway(light_slab.v, "v");
  at_viewpoints_ = make_caster(light_slab);
  at_between_u_ = make_caster(between_u_);
  at_between_v_ = make_caster(between_v_);
}

std::size_t LeastSquaresFieldCaster::held_samples(const WorkUnit& unit) {
  const auto u = static_cast<std::size_t>(unit.u.count);
  const auto v = static_cast<std::size_t>(unit.v.count);
  const std::size_t viewpoints = (u + 2) * (v + 2) + (u + 1) * v + u * (v + 1);
  return unit.sample_count() / (u * v) * viewpoints;
}

void LeastSquaresFieldCaster::cast(const WorkUnit& unit, std::span<std::uint16_t> samples) const {
  check(samples.size() == unit.sample_count(), "one sample per node of the unit");
  const NodeRange near_u = with_neighbours(unit.u, u_nodes_);
  const NodeRange near_v = with_neighbours(unit.v, v_nodes_);
  const CastSamples nodes(*at_viewpoints_, unit, near_u, near_v);
  const CastSamples between_u(*at_between_u_, unit, cells_of(near_u), unit.v);
  const CastSamples between_v(*at_between_v_, unit, unit.u, cells_of(near_v));
  std::uint16_t* out = samples.data();
  for (int u = unit.u.begin; u < unit.u.end(); ++u)
    for (int v = unit.v.begin; v < unit.v.end(); ++v, out += nodes.per_viewpoint()) {
      const std::uint16_t* own = nodes.at(u, v);
      const Cells along_u = cells_beside(u, u_nodes_, [&](int other) {
        return Cell{between_u.at(std::min(u, other), v), nodes.at(other, v)};
      });
      const Cells along_v = cells_beside(v, v_nodes_, [&](int other) {
        return Cell{between_v.at(u, std::min(v, other)), nodes.at(u, other)};
      });
      for (std::size_t i = 0; i < nodes.per_viewpoint(); ++i) {
        const std::int32_t sum =
            6 * own[i] + six_changes(along_u, own[i], i) + six_changes(along_v, own[i], i);
        constexpr std::int32_t kMost = std::numeric_limits<std::uint16_t>::max();
        out[i] = static_cast<std::uint16_t>(
            std::min(static_cast<std::uint32_t>(std::max(sum, 0) + 3) / 6u, std::uint32_t{kMost}));
      }
    }
}

}  // namespace af
