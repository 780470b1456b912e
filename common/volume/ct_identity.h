// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <tuple>

#include "volume/ct_volume.h"

namespace af {

/// Which CT it is: its voxels, and where they lie. The order of axes in its file says nothing.
struct CtIdentity {
  std::string content_sha256;  ///< of size and int16 HU voxels, axes in ascending LPS
  CtGrid grid;                 ///< its axes in ascending LPS

  auto members() {
    return std::tie(content_sha256, grid.size, grid.origin_mm, grid.spacing_mm, grid.direction);
  }
};

/// Places that lie no farther apart are one: the files of one CT differ in the last digits of its
/// grid.
inline constexpr double kSamePlaceMm = 1e-3;

bool is_same_place(const Eigen::Vector3d& a_mm, const Eigen::Vector3d& b_mm);

/// The largest distance between the places that two grids of one size give to a corner's voxel.
double largest_corner_shift_mm(const CtGrid& a, const CtGrid& b);

/// The hash, and the places of the first and the last voxel.
std::string text(const CtIdentity& ct);

/// What makes `found` another CT than `expected`: other voxels, or the corner that lies farthest
/// off. Empty when they are the same CT.
std::string ct_difference(const CtIdentity& expected, const CtIdentity& found);

/// FileError unless the file at `path` is of `expected`, which `expected_is` names.
void require_same_ct(const std::string& path,
                     const CtIdentity& expected,
                     const std::string& expected_is,
                     const CtIdentity& found);

}  // namespace af
