// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "field/compressed_attenuation_field.h"

namespace af {

/// Decodes a field whose codebook has a filter, a few rows of tiles along t at a time: of as many
/// viewpoints as fields of several slabs have, their coefficients stay in cache. \test
/// FilteredDecoding.EqualsTheDefinition
class FilteredDecoding {
 public:
  /// `field` must outlive it.
  explicit FilteredDecoding(const CompressedAttenuationField& field);

  /// Rows begin ... end - 1 of a slab's tiles along t, of every viewpoint, into all samples of the
  /// slab, [u][v][t][s] as FieldLevelSlab has them. Re-entrant.
  void decode(std::size_t slab, int begin, int end, std::span<std::uint16_t> samples) const;

 private:
  const CompressedAttenuationField& field_;
  std::vector<TileCoefficients> codewords_;  ///< with mean 0
};

}  // namespace af
