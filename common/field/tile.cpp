// SPDX-License-Identifier: Apache-2.0
#include "field/tile.h"

#include <algorithm>

namespace af {

TileCoefficients hadamard_coefficients(const Tile& tile) {
  TileCoefficients values{};
  std::copy(tile.begin(), tile.end(), values.begin());
  for (std::size_t stride = 1; stride < kTileElements; stride *= 2)
    for (std::size_t i = 0; i < kTileElements; ++i)
      if ((i & stride) == 0) {
        const float a = values[i];
        const float b = values[i | stride];
        values[i] = a + b;
        values[i | stride] = a - b;
      }
  return values;
}

}  // namespace af
