// SPDX-License-Identifier: Apache-2.0
#include "precompute/casting/unit_tiles.h"

#include <algorithm>
#include <bit>
#include <string>

#include "base/error.h"

namespace af {

namespace {

/// The eight rows of samples that form a row of tiles along t, in the order of tile_element.
using SampleRows = std::array<const std::uint16_t*, 8>;

SampleRows rows_of_tiles(const WorkUnit& unit,
                         std::span<const std::uint16_t> samples,
                         const std::array<int, 3>& tile) {
  SampleRows rows{};
  for (unsigned i = 0; i < rows.size(); ++i) {
    const int u = std::min(2 * tile[0] + static_cast<int>(i >> 2u), unit.u.count - 1);
    const int v = std::min(2 * tile[1] + static_cast<int>((i >> 1u) & 1u), unit.v.count - 1);
    const int s = std::min(2 * tile[2] + static_cast<int>(i & 1u), unit.s.count - 1);
    const std::size_t row = (static_cast<std::size_t>(u) * static_cast<std::size_t>(unit.v.count) +
                             static_cast<std::size_t>(v)) *
                                static_cast<std::size_t>(unit.s.count) +
                            static_cast<std::size_t>(s);
    rows[i] = samples.data() + row * static_cast<std::size_t>(unit.t.count);
  }
  return rows;
}

/// Calls visit(local_tile, tile) for every tile that is not all zero, in order.
template <typename Visit>
void for_each_occupied_tile(const WorkUnit& unit,
                            std::span<const std::uint16_t> samples,
                            Visit&& visit) {
  const auto counts = unit.tile_counts();
  std::size_t local_tile = 0;
  for (int a = 0; a < counts[0]; ++a)
    for (int b = 0; b < counts[1]; ++b)
      for (int c = 0; c < counts[2]; ++c) {
        const SampleRows rows = rows_of_tiles(unit, samples, {a, b, c});
        for (int d = 0; d < counts[3]; ++d, ++local_tile) {
          const int t_0 = 2 * d;
          const int t_1 = std::min(t_0 + 1, unit.t.count - 1);
          Tile tile{};
          for (std::size_t i = 0; i < rows.size(); ++i) {
            tile[2 * i] = rows[i][t_0];
            tile[2 * i + 1] = rows[i][t_1];
          }
          if (!is_zero(tile)) visit(local_tile, tile);
        }
      }
}

}  // namespace

UnitTiles make_unit_tiles(const WorkUnit& unit, std::span<const std::uint16_t> samples) {
  check(samples.size() == unit.sample_count(), "one sample per node of the unit");
  UnitTiles result;
  result.unit_id = unit.id;
  result.occupied.assign((unit.tile_count() + 63) / 64, 0);
  std::size_t count = 0;
  for_each_occupied_tile(unit, samples, [&](std::size_t local_tile, const Tile&) {
    result.occupied[local_tile / 64] |= std::uint64_t{1} << (local_tile % 64);
    ++count;
  });
  // Tiles are counted first, because a growing vector would temporarily take three times the
  // memory.
  result.tiles.reserve(count);
  for_each_occupied_tile(
      unit, samples, [&](std::size_t, const Tile& tile) { result.tiles.push_back(tile); });
  return result;
}

std::vector<std::string> problems(const UnitTiles& tiles, const WorkUnit& unit) {
  const std::size_t tile_count = unit.tile_count();
  if (tiles.occupied.size() != (tile_count + 63) / 64)
    return {"unit " + std::to_string(unit.id) + ": its bitmap has the wrong size"};
  std::size_t occupied = 0;
  for (const std::uint64_t word : tiles.occupied)
    occupied += static_cast<std::size_t>(std::popcount(word));
  std::vector<std::string> found;
  if (tile_count % 64 != 0 && (tiles.occupied.back() >> (tile_count % 64)) != 0)
    found.push_back("unit " + std::to_string(unit.id) +
                    ": its bitmap names tiles it does not have");
  if (occupied != tiles.tiles.size())
    found.push_back("unit " + std::to_string(unit.id) + ": its bitmap and its tiles disagree");
  return found;
}

}  // namespace af
