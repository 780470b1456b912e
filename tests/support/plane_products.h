// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <span>

namespace af::test {

/// Sums over the pixels of two images, or of many pairs of them.
struct PlaneProducts {
  double ab = 0.0, aa = 0.0, bb = 0.0;

  void add(std::span<const float> a, std::span<const float> b) {
    for (std::size_t i = 0; i < a.size(); ++i) {
      ab += static_cast<double>(a[i]) * static_cast<double>(b[i]);
      aa += static_cast<double>(a[i]) * static_cast<double>(a[i]);
      bb += static_cast<double>(b[i]) * static_cast<double>(b[i]);
    }
  }
  /// ||a - b|| / ||b||.
  [[nodiscard]] double relative_distance() const { return std::sqrt((aa - 2.0 * ab + bb) / bb); }
  [[nodiscard]] double cosine() const { return ab / std::sqrt(aa * bb); }
};

}  // namespace af::test
