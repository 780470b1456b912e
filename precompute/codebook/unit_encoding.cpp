// SPDX-License-Identifier: Apache-2.0
#include "precompute/codebook/unit_encoding.h"

#include <numeric>

#include "precompute/codebook/mean_removal.h"

namespace af {

namespace {

/// Distance from the zero tile.
std::uint64_t squared_levels(const Tile& tile) {
  std::uint64_t sum = 0;
  for (const std::uint64_t level : tile) sum += level * level;
  return sum;
}

EncodedUnit encode_plain(const NearestCodeword& search,
                         const WorkUnit& unit,
                         const UnitTiles& tiles) {
  std::vector<std::uint32_t> nearest(tiles.tiles.size());
  std::vector<std::uint64_t> squared_errors(tiles.tiles.size());
  search.search(tiles.tiles, SearchHint::None, nearest, squared_errors);
  EncodedUnit encoded;
  encoded.indices.assign(unit.tile_count(), 0);
  std::size_t next = 0;
  tiles.for_each([&](std::size_t local_tile, const Tile&) {
    encoded.indices[local_tile] = static_cast<std::uint16_t>(nearest[next++]);
  });
  encoded.squared_error =
      std::accumulate(squared_errors.begin(), squared_errors.end(), std::uint64_t{0});
  return encoded;
}

EncodedUnit encode_mean_removed(const NearestCodeword& search,
                                const WorkUnit& unit,
                                const UnitTiles& tiles) {
  std::vector<Tile> shapes;
  std::vector<std::uint16_t> means;
  shapes.reserve(tiles.tiles.size());
  means.reserve(tiles.tiles.size());
  for (const Tile& tile : tiles.tiles) {
    const MeanRemovedTile removed = remove_mean(tile, search.mean_step());
    shapes.push_back(removed.shape);
    means.push_back(removed.mean);
  }
  std::vector<std::uint32_t> nearest(shapes.size());
  std::vector<std::uint64_t> squared_errors(shapes.size());
  search.search(shapes, SearchHint::None, nearest, squared_errors);
  EncodedUnit encoded;
  encoded.indices.assign(2 * unit.tile_count(), 0);
  const auto row = static_cast<std::size_t>(unit.tile_counts()[3]);
  std::size_t next = 0;
  tiles.for_each([&](std::size_t local_tile, const Tile& tile) {
    const std::size_t at = local_tile / row * 2 * row + local_tile % row;
    const std::size_t i = next++;
    // A tile of few, low levels may be nearer to the empty tile than to any shape.
    if (means[i] == 0 && squared_levels(tile) <= squared_errors[i]) {
      encoded.squared_error += squared_levels(tile);
      return;
    }
    encoded.indices[at] = static_cast<std::uint16_t>(nearest[i]);
    encoded.indices[at + row] = nearest[i] == 0 ? std::uint16_t{0} : means[i];
    encoded.squared_error += squared_errors[i];
  });
  return encoded;
}

}  // namespace

EncodedUnit encode_unit(const NearestCodeword& search,
                        const WorkUnit& unit,
                        const UnitTiles& tiles) {
  return search.mean_step() > 0 ? encode_mean_removed(search, unit, tiles)
                                : encode_plain(search, unit, tiles);
}

}  // namespace af
