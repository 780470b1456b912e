// SPDX-License-Identifier: Apache-2.0
#include "ct/ct_identity.h"

#include <iomanip>
#include <sstream>

#include "base/error.h"

namespace af {

namespace {

std::string size_text(const CtGrid& grid) {
  return std::to_string(grid.size[0]) + " x " + std::to_string(grid.size[1]) + " x " +
         std::to_string(grid.size[2]) + " voxels";
}

std::string place_text(const Eigen::Vector3d& point_mm) {
  std::ostringstream text;
  // A micrometre is enough, because places are compared to that.
  text << std::setprecision(7) << "(" << point_mm.x() << ", " << point_mm.y() << ", "
       << point_mm.z() << ") mm";
  return text.str();
}

}  // namespace

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
