// SPDX-License-Identifier: Apache-2.0
#include "precompute/design/patch_nodes.h"

#include <algorithm>
#include <cmath>

#include "precompute/codebook/unit_encoding.h"

namespace af {

namespace {

/// Nodes that the cubic look-up reads beyond the cell of a ray, on either side.
constexpr int kCubicReach = 3;

/// Whole tiles that hold the nodes around [low, high].
NodeRange tiles_around(double low, double high, int reach, int nodes) {
  const int last = nodes - 1;
  const auto begin = static_cast<int>(std::clamp(std::floor(low) - reach, 0.0, last - 1.0)) & ~1;
  const auto end =
      static_cast<int>(std::clamp(std::floor(high) + 1.0 + reach, begin + 1.0, 1.0 * last)) | 1;
  return {begin, std::min(end, last) + 1 - begin};
}

/// Lower node and the upper one's weight.
struct Tap {
  int node;
  double weight;

  Tap(double coordinate, int nodes)
      : node(std::clamp(static_cast<int>(std::floor(coordinate)), 0, nodes - 2)),
        weight(coordinate - node) {}
};

/// Values of the nodes of a rectangle of (s,t), t fastest.
struct NodeValues {
  int s_count;
  int t_count;
  std::vector<double> values;

  NodeValues(int s, int t)
      : s_count(s), t_count(t), values(static_cast<std::size_t>(s) * static_cast<std::size_t>(t)) {}
  [[nodiscard]] double& at(int s, int t) {
    return values[static_cast<std::size_t>(s) * static_cast<std::size_t>(t_count) +
                  static_cast<std::size_t>(t)];
  }
  [[nodiscard]] double at(int s, int t) const { return const_cast<NodeValues&>(*this).at(s, t); }

  [[nodiscard]] double bilinear(double s, double t) const {
    const Tap along_s(s, s_count);
    const Tap along_t(t, t_count);
    const auto row = [&](int node) {
      return (1.0 - along_t.weight) * at(node, along_t.node) +
             along_t.weight * at(node, along_t.node + 1);
    };
    return (1.0 - along_s.weight) * row(along_s.node) + along_s.weight * row(along_s.node + 1);
  }
};

/// A node halfway between any two, by Lagrange's polynomial through six. The edge is replicated.
template <typename At>
double halfway(const At& at, int below, int count) {
  constexpr std::array<double, kCubicReach> kWeights = {150.0 / 256, -25.0 / 256, 3.0 / 256};
  double sum = 0.0;
  for (int i = 0; i < kCubicReach; ++i)
    sum += kWeights[static_cast<std::size_t>(i)] *
           (at(std::max(0, below - i)) + at(std::min(count - 1, below + 1 + i)));
  return sum;
}

NodeValues twice_as_fine(const NodeValues& nodes) {
  NodeValues fine(2 * nodes.s_count - 1, 2 * nodes.t_count - 1);
  for (int s = 0; s < nodes.s_count; ++s)
    for (int t = 0; t < nodes.t_count; ++t) {
      fine.at(2 * s, 2 * t) = nodes.at(s, t);
      if (t + 1 < nodes.t_count)
        fine.at(2 * s, 2 * t + 1) =
            halfway([&](int i) { return nodes.at(s, i); }, t, nodes.t_count);
    }
  for (int s = 0; s + 1 < nodes.s_count; ++s)
    for (int t = 0; t < fine.t_count; ++t)
      fine.at(2 * s + 1, t) = halfway([&](int i) { return fine.at(2 * i, t); }, s, nodes.s_count);
  return fine;
}

}  // namespace

PatchNodes::PatchNodes(const FieldCaster& caster,
                       const LightSlab& planes,
                       float quantizer_step,
                       const RayPatch& patch)
    : planes_(planes), quantizer_step_(quantizer_step), patch_(patch) {
  for (std::size_t k = 0; k < planes.slabs.size(); ++k) {
    RayNodes low{1e9, 1e9, 1e9, 1e9};
    RayNodes high{-1e9, -1e9, -1e9, -1e9};
    for (const Eigen::Vector3d& direction : patch.directions) {
      const auto nodes = planes.intersect({patch.source_point, direction}, planes.slabs[k]);
      if (!nodes) continue;  // within rounding of a plane's edge
      low = {std::min(low.u, nodes->u),
             std::min(low.v, nodes->v),
             std::min(low.s, nodes->s),
             std::min(low.t, nodes->t)};
      high = {std::max(high.u, nodes->u),
              std::max(high.v, nodes->v),
              std::max(high.s, nodes->s),
              std::max(high.t, nodes->t)};
    }
    WorkUnit unit;
    unit.slab = k;
    unit.u = tiles_around(low.u, high.u, 0, planes.u.nodes);
    unit.v = tiles_around(low.v, high.v, 0, planes.v.nodes);
    unit.s = tiles_around(low.s, high.s, kCubicReach, planes.slabs[k].s.nodes);
    unit.t = tiles_around(low.t, high.t, kCubicReach, planes.slabs[k].t.nodes);
    samples_.emplace_back(unit.sample_count());
    caster.cast(unit, samples_.back());
    units_.push_back(unit);
  }
}

PatchValues PatchNodes::values_of(const SlabSamples& samples) const {
  PatchValues sum;
  for (std::size_t k = 0; k < units_.size(); ++k) add_slab(k, samples[k], sum);
  return sum;
}

void PatchNodes::add_slab(std::size_t k,
                          const std::vector<std::uint16_t>& samples,
                          PatchValues& sum) const {
  const WorkUnit& unit = units_[k];
  const SlabGeometry& slab = planes_.slabs[k];
  if (std::ranges::none_of(samples, [](std::uint16_t level) { return level != 0; })) return;
  // In the first pass, viewpoints are blended at every node, by where the ray from the source to it
  // meets the (u,v) plane.
  NodeValues blended(unit.s.count, unit.t.count);
  const Eigen::Vector3d& source = patch_.source_point;
  const double reach = (planes_.uv_plane_y_mm - source.y()) / (slab.st_plane_y_mm - source.y());
  const auto viewpoint =
      [&](const GridAxis& axis, double from_mm, double node_mm, const NodeRange& range) {
        const double at = axis.node_coordinate(from_mm + reach * (node_mm - from_mm)) - range.begin;
        return Tap(std::clamp(at, 0.0, range.count - 1.0), range.count);
      };
  const std::size_t t_count = static_cast<std::size_t>(unit.t.count);
  const std::size_t per_v = static_cast<std::size_t>(unit.s.count) * t_count;
  const std::size_t per_u = static_cast<std::size_t>(unit.v.count) * per_v;
  for (int s = 0; s < unit.s.count; ++s) {
    const Tap u = viewpoint(planes_.u, source.x(), slab.s.position_mm(unit.s.begin + s), unit.u);
    for (int t = 0; t < unit.t.count; ++t) {
      const Tap v = viewpoint(planes_.v, source.z(), slab.t.position_mm(unit.t.begin + t), unit.v);
      const std::size_t at = static_cast<std::size_t>(u.node) * per_u +
                             static_cast<std::size_t>(v.node) * per_v +
                             static_cast<std::size_t>(s) * t_count + static_cast<std::size_t>(t);
      blended.at(s, t) =
          (1.0 - u.weight) * ((1.0 - v.weight) * samples[at] + v.weight * samples[at + per_v]) +
          u.weight *
              ((1.0 - v.weight) * samples[at + per_u] + v.weight * samples[at + per_u + per_v]);
    }
  }
  const NodeValues fine = twice_as_fine(blended);
  for (std::size_t i = 0; i < patch_.directions.size(); ++i) {
    const Eigen::Vector3d hit = source + (slab.st_plane_y_mm - source.y()) /
                                             patch_.directions[i].y() * patch_.directions[i];
    const double s = slab.s.node_coordinate(hit.x()) - unit.s.begin;
    const double t = slab.t.node_coordinate(hit.z()) - unit.t.begin;
    sum.linear[i] += static_cast<double>(quantizer_step_) * blended.bilinear(s, t);
    sum.cubic[i] += static_cast<double>(quantizer_step_) * fine.bilinear(2.0 * s, 2.0 * t);
  }
}

PatchValues PatchNodes::values(const NearestCodeword& search, const Codebook& codebook) const {
  SlabSamples coded = samples_;
  for (std::size_t k = 0; k < units_.size(); ++k) {
    const WorkUnit& unit = units_[k];
    const UnitTiles tiles = make_unit_tiles(unit, samples_[k]);
    const std::vector<std::uint16_t> indices = encode_unit(search, unit, tiles).indices;
    const auto row = static_cast<std::size_t>(unit.tile_counts()[3]);
    const std::array<int, 4> counts = unit.tile_counts();
    const std::array<int, 4> nodes = {unit.u.count, unit.v.count, unit.s.count, unit.t.count};
    tiles.for_each([&](std::size_t local, const Tile& /*tile*/) {
      const std::size_t code = codebook.has_means() ? local / row * 2 * row + local % row : local;
      const Tile& codeword = codebook.codewords[indices[code]];
      std::array<int, 4> first{};
      for (std::size_t axis = 4; axis-- > 0;) {
        first[axis] = 2 * static_cast<int>(local % static_cast<std::size_t>(counts[axis]));
        local /= static_cast<std::size_t>(counts[axis]);
      }
      for (unsigned element = 0; element < kTileElements; ++element) {
        std::size_t at = 0;
        bool is_padding = false;
        for (unsigned axis = 0; axis < 4; ++axis) {
          const int node = first[axis] + static_cast<int>(element >> (3 - axis) & 1u);
          is_padding = is_padding || node >= nodes[axis];
          at = at * static_cast<std::size_t>(nodes[axis]) + static_cast<std::size_t>(node);
        }
        if (!is_padding)
          coded[k][at] = codebook.has_means() ? level_of(codeword[element], indices[code + row])
                                              : codeword[element];
      }
    });
  }
  return values_of(coded);
}

}  // namespace af
