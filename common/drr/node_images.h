// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>

namespace af {

/// Equidistant nodes of an image on a plane y = plane_y_mm of the slab frame.
struct NodeGrid {
  double s_first_mm, s_spacing_mm;
  double t_first_mm, t_spacing_mm;
  double plane_y_mm;
  std::int32_t stride, s_count, t_count;
};

/// Images at the nodes of one grid: the value and, unless null, its slopes along the source's x and
/// z (per mm).
struct NodeImages {
  NodeGrid grid;
  std::array<const float*, 3> images;
};

}  // namespace af
