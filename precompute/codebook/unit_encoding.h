// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "precompute/casting/unit_tiles.h"
#include "precompute/codebook/nearest_codeword.h"

namespace af {

/// Codeword indices and means of one unit's tiles, stored as Codebook says, and the exact sum of
/// their squared errors in levels. Empty tiles get codeword 0. With means, decoding clamps levels
/// to 0 ... 65535, but errors are counted before clamping.
struct EncodedUnit {
  std::vector<std::uint16_t> indices;
  std::uint64_t squared_error = 0;
};

EncodedUnit encode_unit(const NearestCodeword& search,
                        const WorkUnit& unit,
                        const UnitTiles& tiles);

}  // namespace af
