// SPDX-License-Identifier: Apache-2.0
// The tile filter of a field. It is fitted to patches of the field, whole neighbourhoods, that are
// cast once more when the codebook is known.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "field/codebook.h"
#include "precompute/casting/unit_tiles.h"
#include "precompute/codebook/nearest_codeword.h"

namespace af {

/// Where a field is cast for its filter: 72 units of at most 12 viewpoints along u and v, 16 nodes
/// along s and kRunOfT along t, at random places of slabs spread over the field, each place once.
/// The same for any plan and number of ranks.
std::vector<WorkUnit> filter_patches(const FieldLattice& lattice, std::uint64_t seed);

/// What a fit found, over the tiles of all patches.
struct FittedFilter {
  std::optional<TileFilter> filter;  ///< none: there are too few tiles to tell
  std::uint64_t tiles = 0;     ///< a third of those that are not empty and have their neighbours
                               ///< within the patch
  double squared_error = 0.0;  ///< of these, in squared levels, not yet rounded and limited
  double squared_error_left = 0.0;  ///< with the filter
};

/// Sums for the normal equations of a TileFilter. They are exact integers, so that the order of
/// tiles and the number of ranks do not matter. Levels have 16 bits, so inputs stay below 2^23, and
/// products of 2^17 fitted tiles, more than the patches have, below 2^63.
class FilterSums {
 public:
  /// `codebook` must outlive it.
  explicit FilterSums(const Codebook& codebook);
  explicit FilterSums(Codebook&& codebook) = delete;

  /// Adds the tiles of a patch as cast, and as they will be decoded. `slab` is the patch's, which
  /// tells the end of the lattice from that of the patch.
  void add(const WorkUnit& patch, const SlabLattice& slab, const UnitTiles& tiles);
  /// Values to sum over ranks, element by element, modulo 2^64.
  [[nodiscard]] std::span<std::uint64_t> values() { return values_; }

  /// The weights with the least squared error.
  [[nodiscard]] FittedFilter fit() const;

 private:
  [[nodiscard]] std::span<const std::uint64_t> of_coefficient(std::size_t j) const;

  const Codebook& codebook_;
  NearestCodeword search_;
  /// The number of tiles. Then, for each coefficient, the products of its inputs and of the decoded
  /// tile's error with one another, on and above the diagonal, row by row.
  std::vector<std::uint64_t> values_;
};

}  // namespace af
