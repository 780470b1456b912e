// SPDX-License-Identifier: Apache-2.0
// Tiles that become codewords, drawn from those of all ranks.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "precompute/codebook/codebook_reduction.h"
#include "precompute/codebook/tile_selection.h"

namespace af {

/// A tile with the key by which it is picked.
struct KeyedTile {
  std::uint64_t key = 0;
  NumberedTile numbered;
};

inline constexpr std::uint64_t kNeverPicked = ~std::uint64_t{0};

/// Collective. The `count` tiles with the smallest keys over all ranks (ties: smallest global
/// index), sorted by (key, index), the same on every rank. All tiles when there are fewer.
/// `keys[i]` belongs to `tiles[i]`; kNeverPicked keeps a tile out. Only the picked tiles travel:
/// four summed histograms find the largest key.
std::vector<KeyedTile> smallest_keyed_tiles(std::span<const std::uint64_t> keys,
                                            std::span<const NumberedTile> tiles,
                                            std::uint64_t count,
                                            const CodebookReduction& reduction);

/// A key whose smallest values are a sample without replacement, with probabilities proportional to
/// the square root of the tiles' AC norm (Efraimidis and Spirakis 2006: an exponential variate
/// divided by the weight). It uses correctly rounded operations only, so it has the same bits
/// everywhere.
std::uint64_t weighted_sampling_key(std::uint64_t seed, const NumberedTile& tile);

}  // namespace af
