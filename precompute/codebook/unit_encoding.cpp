// SPDX-License-Identifier: Apache-2.0
#include "precompute/codebook/unit_encoding.h"

#include <numeric>

namespace af {

EncodedUnit encode_unit(const NearestCodeword& search,
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

}  // namespace af
