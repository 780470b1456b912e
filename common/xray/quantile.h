// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

namespace af {

/// The smallest value that `share` (0 to 1) of the values do not exceed. `values` is not empty.
float nearest_rank(std::vector<float> values, double share);

}  // namespace af
