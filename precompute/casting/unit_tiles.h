// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "field/tile.h"
#include "precompute/casting/work_unit.h"

namespace af {

/// What is kept of a cast unit: which of its tiles are not empty, and those tiles, in tile order
/// [u][v][s][t].
struct UnitTiles {
  std::uint32_t unit_id = 0;
  std::vector<std::uint64_t> occupied;  ///< bit i % 64 of word i / 64: tile i is not all zero
  std::vector<Tile> tiles;

  /// Calls visit(local_tile, tile) for every tile that is not empty, in order.
  template <typename Visit>
  void for_each(Visit&& visit) const {
    std::size_t next = 0;
    for (std::size_t word = 0; word < occupied.size(); ++word)
      for (std::uint64_t bits = occupied[word]; bits != 0; bits &= bits - 1)
        visit(word * 64 + static_cast<std::size_t>(__builtin_ctzll(bits)), tiles[next++]);
  }

  [[nodiscard]] std::size_t memory_bytes() const {
    return occupied.capacity() * sizeof(std::uint64_t) + tiles.capacity() * sizeof(Tile);
  }
};

/// Gathers the samples of a unit, [u][v][s][t], into tiles. Odd sizes are padded by replicating the
/// last node.
UnitTiles make_unit_tiles(const WorkUnit& unit, std::span<const std::uint16_t> samples);

/// Why the tiles cannot belong to the unit (sizes, bits beyond the last tile). Empty when they can.
std::vector<std::string> problems(const UnitTiles& tiles, const WorkUnit& unit);

}  // namespace af
