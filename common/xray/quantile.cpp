// SPDX-License-Identifier: Apache-2.0
#include "xray/quantile.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"

namespace af {

float nearest_rank(std::vector<float> values, double share) {
  check(!values.empty(), "a quantile is that of some values");
  const auto rank = static_cast<std::size_t>(
      std::max(1.0, std::ceil(share * static_cast<double>(values.size()))));
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(rank - 1);
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

}  // namespace af
