// SPDX-License-Identifier: Apache-2.0
#include "field/tile_filter.h"

#include <cmath>

namespace af {

std::vector<std::string> problems(const TileFilter& filter) {
  for (const auto& of_coefficient : filter.weights)
    for (const float weight : of_coefficient)
      if (!(std::abs(weight) <= kLargestFilterWeight))
        return {"tile_filter: weights must be within 1e6 of 0"};
  return {};
}

}  // namespace af
