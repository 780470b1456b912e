// SPDX-License-Identifier: Apache-2.0
#include "precompute/design/field_sample.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "precompute/casting/unit_planner.h"

namespace af {

namespace {

/// Block `i` of `count` blocks of viewpoints, spread such that no two share a row or a column.
std::array<NodeRange, 2> viewpoint_block(int i, int count, const SlabLattice& lattice) {
  const auto pair_at = [](double share, const LatticeAxis& axis) {
    const int tiles = axis.stored.tiles();
    const int tile = std::clamp(static_cast<int>(share * tiles), 0, tiles - 1);
    const int begin = axis.stored.begin + 2 * tile;
    return NodeRange{begin, std::min(2, axis.stored.end() - begin)};
  };
  constexpr double kGolden = 0.6180339887498949;
  const double along_v = std::fmod(0.25 + kGolden * (i + 0.5), 1.0);
  return {pair_at((i + 0.5) / count, lattice.u), pair_at(along_v, lattice.v)};
}

}  // namespace

FieldSample sample_field(const FieldCaster& caster,
                         const FieldLattice& lattice,
                         int viewpoints,
                         const ProbeShare& share) {
  FieldSample sample;
  std::vector<std::uint16_t> levels;
  for (std::size_t k = 0; k < lattice.slabs.size(); ++k) {
    const SlabLattice& slab = lattice.slabs[k];
    const double blocks = 1.0 * slab.u.stored.tiles() * slab.v.stored.tiles();
    for (int i = 0; i < viewpoints; ++i) {
      WorkUnit unit;
      unit.slab = k;
      const auto block = viewpoint_block(i, viewpoints, slab);
      unit.u = block[0];
      unit.v = block[1];
      for (int s = slab.s.stored.begin; s < slab.s.stored.end(); s += kLargestS)
        for (int t = slab.t.stored.begin; t < slab.t.stored.end(); t += kLargestT) {
          unit.s = {s, std::min(kLargestS, slab.s.stored.end() - s)};
          unit.t = {t, std::min(kLargestT, slab.t.stored.end() - t)};
          const std::size_t number = sample.tiles_meant.size();
          sample.tiles_meant.push_back(static_cast<double>(unit.tile_count()) * blocks /
                                       viewpoints);
          sample.occupied_share.push_back(0.0);
          if (!share.has(number)) continue;
          levels.resize(unit.sample_count());
          caster.cast(unit, levels);
          UnitTiles tiles = make_unit_tiles(unit, levels);
          sample.occupied_share.back() =
              static_cast<double>(tiles.tiles.size()) / static_cast<double>(unit.tile_count());
          sample.chunks.push_back({unit, std::move(tiles)});
        }
    }
  }
  return sample;
}

}  // namespace af
