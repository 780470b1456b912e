// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>

#include <Eigen/Core>

namespace af {

/// Where a CT's voxels lie in the ct frame (DICOM LPS, mm).
struct CtGrid {
  std::array<int, 3> size = {0, 0, 0};                  ///< voxels along i, j, k
  Eigen::Vector3d origin_mm = Eigen::Vector3d::Zero();  ///< centre of voxel (0, 0, 0)
  Eigen::Vector3d spacing_mm = Eigen::Vector3d::Ones();
  Eigen::Matrix3d direction = Eigen::Matrix3d::Identity();  ///< columns: directions of i, j, k

  [[nodiscard]] std::size_t voxel_count() const {
    return static_cast<std::size_t>(size[0]) * static_cast<std::size_t>(size[1]) *
           static_cast<std::size_t>(size[2]);
  }
  /// ct point (mm) of continuous voxel indices (i, j, k).
  [[nodiscard]] Eigen::Vector3d point_mm(const Eigen::Vector3d& index) const {
    return origin_mm + direction * spacing_mm.cwiseProduct(index);
  }
  /// Continuous voxel indices of a ct point (mm); `direction` is orthonormal.
  [[nodiscard]] Eigen::Vector3d index_of(const Eigen::Vector3d& ct_point_mm) const {
    return (direction.transpose() * (ct_point_mm - origin_mm)).cwiseQuotient(spacing_mm);
  }
  /// Centre of the volume.
  [[nodiscard]] Eigen::Vector3d center_mm() const {
    return point_mm(Eigen::Vector3d(size[0] - 1, size[1] - 1, size[2] - 1) / 2.0);
  }
};

/// Places no farther apart than this count as one: files of the same CT differ in the last digits
/// of its grid.
inline constexpr double kSamePlaceMm = 1e-3;

bool is_same_place(const Eigen::Vector3d& a_mm, const Eigen::Vector3d& b_mm);

/// The centres of the corner voxels: (0, 0, 0) first, the opposite corner last.
std::array<Eigen::Vector3d, 8> corners_mm(const CtGrid& grid);

/// The corner whose places lie farthest apart in two grids of one size, as an index of
/// corners_mm().
std::size_t farthest_corner(const CtGrid& a, const CtGrid& b);

/// The largest distance between the places that two grids of one size give to a corner voxel.
double largest_corner_shift_mm(const CtGrid& a, const CtGrid& b);

}  // namespace af
