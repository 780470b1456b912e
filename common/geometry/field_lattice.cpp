// SPDX-License-Identifier: Apache-2.0
#include "geometry/field_lattice.h"

namespace af {

namespace {

template <typename CountOfAxis>
std::int64_t product_over_axes(const SlabLattice& slab, const CountOfAxis& count_of) {
  std::int64_t product = 1;
  for (const LatticeAxis& axis : slab.axes()) product *= count_of(axis);
  return product;
}

void append_axis_problems(const std::string& name,
                          const LatticeAxis& axis,
                          std::vector<std::string>& found) {
  const NodeRange& range = axis.stored;
  if (axis.nodes < 2 || axis.nodes > kMaxNodes)
    found.push_back(name + " nodes = " + std::to_string(axis.nodes) + ": must be between 2 and " +
                    std::to_string(kMaxNodes));
  else if (range.begin < 0 || range.begin % 2 != 0 || range.begin > axis.nodes || range.count < 1 ||
           range.count > axis.nodes - range.begin ||
           (range.count % 2 != 0 && range.end() != axis.nodes))
    found.push_back(name + " stored range [" + std::to_string(range.begin) + ", +" +
                    std::to_string(range.count) + ") is not an even-aligned part of " +
                    std::to_string(axis.nodes) + " nodes");
}

}  // namespace

std::int64_t SlabLattice::tile_count() const {
  return product_over_axes(*this, [](const LatticeAxis& axis) { return axis.stored.tiles(); });
}

std::int64_t SlabLattice::stored_node_count() const {
  return product_over_axes(*this, [](const LatticeAxis& axis) { return axis.stored.count; });
}

std::int64_t SlabLattice::node_count() const {
  return product_over_axes(*this, [](const LatticeAxis& axis) { return axis.nodes; });
}

std::int64_t FieldLattice::tiles_before(std::size_t slab) const {
  std::int64_t tiles = 0;
  for (std::size_t k = 0; k < slab; ++k) tiles += slabs[k].tile_count();
  return tiles;
}

std::int64_t FieldLattice::stored_node_count() const {
  std::int64_t nodes = 0;
  for (const SlabLattice& slab : slabs) nodes += slab.stored_node_count();
  return nodes;
}

std::int64_t FieldLattice::node_count() const {
  std::int64_t nodes = 0;
  for (const SlabLattice& slab : slabs) nodes += slab.node_count();
  return nodes;
}

std::vector<std::string> problems(const SlabLattice& slab, const std::string& name) {
  std::vector<std::string> found;
  append_axis_problems(name + " u", slab.u, found);
  append_axis_problems(name + " v", slab.v, found);
  append_axis_problems(name + " s", slab.s, found);
  append_axis_problems(name + " t", slab.t, found);
  return found;
}

}  // namespace af
