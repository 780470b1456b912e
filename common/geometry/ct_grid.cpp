// SPDX-License-Identifier: Apache-2.0
#include "geometry/ct_grid.h"

namespace af {

std::array<Eigen::Vector3d, 8> corners_mm(const CtGrid& grid) {
  std::array<Eigen::Vector3d, 8> corners;
  for (unsigned corner = 0; corner < corners.size(); ++corner) {
    Eigen::Vector3d index = Eigen::Vector3d::Zero();
    for (unsigned axis = 0; axis < 3; ++axis)
      if ((corner >> axis & 1u) != 0) index[axis] = static_cast<double>(grid.size[axis]) - 1.0;
    corners[corner] = grid.point_mm(index);
  }
  return corners;
}

std::size_t farthest_corner(const CtGrid& a, const CtGrid& b) {
  const auto wanted = corners_mm(a);
  const auto found = corners_mm(b);
  std::size_t farthest = 0;
  for (std::size_t i = 0; i < wanted.size(); ++i)
    if (!((found[i] - wanted[i]).norm() <= (found[farthest] - wanted[farthest]).norm()))
      farthest = i;
  return farthest;
}

bool is_same_place(const Eigen::Vector3d& a_mm, const Eigen::Vector3d& b_mm) {
  return (a_mm - b_mm).norm() <= kSamePlaceMm;
}

double largest_corner_shift_mm(const CtGrid& a, const CtGrid& b) {
  const std::size_t corner = farthest_corner(a, b);
  return (corners_mm(a)[corner] - corners_mm(b)[corner]).norm();
}

}  // namespace af
