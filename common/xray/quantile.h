// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

namespace af {

/// The smallest value that `share` (0 to 1) of the values do not exceed. `values` is not empty.
float nearest_rank(std::span<const float> values, double share);

}  // namespace af
