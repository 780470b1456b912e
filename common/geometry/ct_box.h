// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <tuple>

#include <Eigen/Core>

namespace af {

/// An axis-aligned box in the ct frame (mm).
struct CtBox {
  Eigen::Vector3d low_mm;
  Eigen::Vector3d high_mm;

  auto members() { return std::tie(low_mm, high_mm); }
  [[nodiscard]] std::array<Eigen::Vector3d, 8> corner_points() const {
    std::array<Eigen::Vector3d, 8> corners;
    for (unsigned i = 0; i < 8; ++i)
      corners[i] = {(i & 1u) != 0 ? high_mm.x() : low_mm.x(),
                    (i & 2u) != 0 ? high_mm.y() : low_mm.y(),
                    (i & 4u) != 0 ? high_mm.z() : low_mm.z()};
    return corners;
  }
};

}  // namespace af
