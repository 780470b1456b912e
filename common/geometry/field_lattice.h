// SPDX-License-Identifier: Apache-2.0
// The nodes of a field as integers, which is all that training, encoding, planning, progress and
// file layout need. The field's geometry knows where nodes lie and which rays they are.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace af {

/// Half-open range of lattice nodes.
struct NodeRange {
  int begin = 0;
  int count = 0;

  [[nodiscard]] int end() const { return begin + count; }
  [[nodiscard]] int tiles() const { return (count + 1) / 2; }
};

/// One axis of a slab's lattice.
struct LatticeAxis {
  int nodes = 0;  ///< of the whole lattice
  /// The stored nodes; all others are exactly 0. The range begins at an even node. Its count is odd
  /// only where it ends at the last node.
  NodeRange stored;
};

/// The four axes of one slab's lattice. Its tiles are numbered [u][v][s][t], t fastest.
struct SlabLattice {
  LatticeAxis u;
  LatticeAxis v;
  LatticeAxis s;
  LatticeAxis t;

  [[nodiscard]] std::array<LatticeAxis, 4> axes() const { return {u, v, s, t}; }
  /// Number of tiles of the stored nodes along each axis.
  [[nodiscard]] std::array<int, 4> tile_counts() const {
    return {u.stored.tiles(), v.stored.tiles(), s.stored.tiles(), t.stored.tiles()};
  }
  [[nodiscard]] std::int64_t tile_count() const;
  [[nodiscard]] std::int64_t stored_node_count() const;
  [[nodiscard]] std::int64_t node_count() const;  ///< of the whole lattice
};

/// All slabs of a field.
struct FieldLattice {
  std::vector<SlabLattice> slabs;

  [[nodiscard]] std::int64_t tile_count() const { return tiles_before(slabs.size()); }
  /// Tiles of the slabs before this one.
  [[nodiscard]] std::int64_t tiles_before(std::size_t slab) const;
  [[nodiscard]] std::int64_t stored_node_count() const;
  [[nodiscard]] std::int64_t node_count() const;  ///< of the whole lattices
};

/// Most nodes along an axis, so that the tiles along four such axes can be counted.
inline constexpr int kMaxNodes = 65536;

/// Why the numbers cannot be a slab's; empty when they can. Messages call the slab `name`.
std::vector<std::string> problems(const SlabLattice& slab, const std::string& name);

}  // namespace af
