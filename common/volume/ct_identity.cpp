// SPDX-License-Identifier: Apache-2.0
#include "volume/ct_identity.h"

#include <array>
#include <iomanip>
#include <sstream>

#include "base/error.h"

namespace af {

namespace {

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

/// The corner that lies farthest off.
std::size_t farthest_corner(const CtGrid& a, const CtGrid& b) {
  const auto wanted = corners_mm(a);
  const auto found = corners_mm(b);
  std::size_t farthest = 0;
  for (std::size_t i = 0; i < wanted.size(); ++i)
    if (!((found[i] - wanted[i]).norm() <= (found[farthest] - wanted[farthest]).norm()))
      farthest = i;
  return farthest;
}

std::string size_text(const CtGrid& grid) {
  return std::to_string(grid.size[0]) + " x " + std::to_string(grid.size[1]) + " x " +
         std::to_string(grid.size[2]) + " voxels";
}

std::string place_text(const Eigen::Vector3d& point_mm) {
  std::ostringstream text;
  // To a micrometre, as places are compared.
  text << std::setprecision(7) << "(" << point_mm.x() << ", " << point_mm.y() << ", "
       << point_mm.z() << ") mm";
  return text.str();
}

}  // namespace

bool is_same_place(const Eigen::Vector3d& a_mm, const Eigen::Vector3d& b_mm) {
  return (a_mm - b_mm).norm() <= kSamePlaceMm;
}

double largest_corner_shift_mm(const CtGrid& a, const CtGrid& b) {
  const std::size_t corner = farthest_corner(a, b);
  return (corners_mm(a)[corner] - corners_mm(b)[corner]).norm();
}

std::string text(const CtIdentity& ct) {
  const auto corners = corners_mm(ct.grid);
  return ct.content_sha256 + ", " + size_text(ct.grid) + " from " + place_text(corners.front()) +
         " to " + place_text(corners.back());
}

std::string ct_difference(const CtIdentity& expected, const CtIdentity& found) {
  if (found.content_sha256 != expected.content_sha256)
    return "its voxels have the SHA-256 " + found.content_sha256 + " instead of " +
           expected.content_sha256;
  if (found.grid.size != expected.grid.size)
    return "it has " + size_text(found.grid) + " instead of " + size_text(expected.grid);
  const std::size_t corner = farthest_corner(expected.grid, found.grid);
  const Eigen::Vector3d wanted = corners_mm(expected.grid)[corner];
  const Eigen::Vector3d place = corners_mm(found.grid)[corner];
  if (is_same_place(place, wanted)) return "";
  std::ostringstream text;
  text << "its voxels are the same, but they lie elsewhere: a corner at " << place_text(place)
       << " instead of " << place_text(wanted) << ", " << std::setprecision(4)
       << (place - wanted).norm() << " mm off";
  return text.str();
}

void require_same_ct(const std::string& path,
                     const CtIdentity& expected,
                     const std::string& expected_is,
                     const CtIdentity& found) {
  const std::string difference = ct_difference(expected, found);
  if (!difference.empty())
    throw FileError(path, "CT of the field", expected_is, "another CT: " + difference);
}

}  // namespace af
