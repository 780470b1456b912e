// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "field/compressed_attenuation_field.h"

namespace af {

/// Decodes a field whose codebook has a filter, a tile of viewpoints at a time. \test
/// FilteredDecoding.EqualsTheDefinition
class FilteredDecoding {
 public:
  explicit FilteredDecoding(std::shared_ptr<const CompressedAttenuationField> field);

  /// Decodes the viewpoints of tile (a, b) of a slab into all samples of the slab, [u][v][t][s] as
  /// in FieldLevelSlab. Re-entrant.
  void decode(std::size_t slab, int a, int b, std::span<std::uint16_t> samples) const;

 private:
  std::shared_ptr<const CompressedAttenuationField> field_;
  std::vector<TileCoefficients> codewords_;  ///< with mean 0
};

}  // namespace af
