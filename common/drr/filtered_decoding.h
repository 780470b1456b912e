// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "field/compressed_attenuation_field.h"

namespace af {

/// Decodes one slab of a field whose codebook has a filter, a few rows of tiles along t at a time:
/// of as many viewpoints as fields of several slabs have, their coefficients stay in cache. Samples
/// are [u][v][t][s], as FieldLevelSlab has them. \test FilteredDecoding.EqualsTheDefinition
class FilteredDecoding {
 public:
  /// `field` must outlive it. `codewords`: decoded_coefficients() of its codebook.
  FilteredDecoding(const CompressedAttenuationField& field,
                   const std::vector<TileCoefficients>& codewords,
                   std::size_t slab);

  /// Rows of tiles along t; parts of them may be decoded at the same time.
  [[nodiscard]] int row_count() const { return tiles_.t; }
  /// Rows begin ... end - 1 of every viewpoint.
  void decode(int begin, int end, std::span<std::uint16_t> samples) const;

 private:
  struct TileCounts {
    int u, v, s, t;
  };
  class Window;

  void decode_rows(int begin, int end, Window& window, std::span<std::uint16_t> samples) const;
  void fill(int u, int v, int first_row, int rows, Window& window) const;
  void store(int u, int v, int row, const Window& window, std::span<std::uint16_t> samples) const;

  const CompressedAttenuationField& field_;
  const std::vector<TileCoefficients>& codewords_;
  std::span<const std::uint16_t> values_;
  SlabLattice lattice_;
  TileCounts tiles_;
};

}  // namespace af
