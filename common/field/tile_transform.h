// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>

#include "field/tile.h"

namespace af {

/// A tile in the coordinates of the 4-D Hadamard transform; coefficient j is the sum of the levels,
/// negative where an element's number shares an odd number of bits with j. Exact.
using TileCoefficients = std::array<float, kTileElements>;

TileCoefficients hadamard_coefficients(const Tile& tile);

}  // namespace af
