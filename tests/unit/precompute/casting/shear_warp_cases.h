// SPDX-License-Identifier: Apache-2.0
// CTs and geometries that the tests of the shear-warp caster share.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <numbers>
#include <vector>

#include "ct/ct_volume.h"
#include "geometry/light_slab.h"

namespace af::test {

inline constexpr double kHalfPi = std::numbers::pi / 2.0;

/// Grid centred at the ct origin.
inline CtGrid centered_grid(const std::array<int, 3>& size, const Eigen::Vector3d& spacing_mm) {
  CtGrid grid;
  grid.size = size;
  grid.spacing_mm = spacing_mm;
  grid.origin_mm = Eigen::Vector3d::Zero();
  grid.origin_mm = -grid.center_mm();
  return grid;
}

/// HU from a function of the ct point.
inline CtVolume ct_of(const CtGrid& grid, const std::function<double(Eigen::Vector3d)>& hu) {
  std::vector<std::int16_t> voxels;
  for (int k = 0; k < grid.size[2]; ++k)
    for (int j = 0; j < grid.size[1]; ++j)
      for (int i = 0; i < grid.size[0]; ++i)
        voxels.push_back(
            static_cast<std::int16_t>(std::lround(hu(grid.point_mm(Eigen::Vector3d(i, j, k))))));
  return {grid, SharedArray<std::int16_t>(std::move(voxels))};
}

/// Two Gaussian bodies, much wider than a voxel, in air.
inline CtVolume smooth_ct() {
  return ct_of(centered_grid({61, 53, 47}, {1.1, 1.2, 1.3}), [](const Eigen::Vector3d& point) {
    const double a = (point - Eigen::Vector3d(5.0, -4.0, 3.0)).squaredNorm() / (2.0 * 100.0);
    const double b = (point - Eigen::Vector3d(-8.0, 6.0, -5.0)).squaredNorm() / (2.0 * 49.0);
    return -1000.0 + 1500.0 * std::exp(-a) + 900.0 * std::exp(-b);
  });
}

/// Slab frames whose axes run along the CT's (three ways) and obliquely.
inline std::vector<Eigen::Matrix3d> aligned_rotations() {
  return {rotation_from_angles({0.0, 0.0, 0.0}),
          rotation_from_angles({kHalfPi, 0.0, 0.0}),
          rotation_from_angles({0.0, kHalfPi, kHalfPi})};
}
inline std::vector<Eigen::Matrix3d> oblique_rotations() {
  return {rotation_from_angles({0.2, -0.3, 0.4}), rotation_from_angles({0.02, 0.7, -0.03})};
}
inline std::vector<Eigen::Matrix3d> all_rotations() {
  auto rotations = aligned_rotations();
  for (const auto& oblique : oblique_rotations()) rotations.push_back(oblique);
  return rotations;
}

/// 5 x 4 viewpoints before a lattice of 83 x 77 nodes (more than two tiles of columns), of which an
/// odd part is stored.
inline LightSlab small_light_slab(const Eigen::Matrix3d& slab_from_ct_rotation) {
  LightSlab light_slab;
  light_slab.slab_from_ct.linear() = slab_from_ct_rotation;
  light_slab.slab_from_ct.translation() = Eigen::Vector3d(1.3, -2.1, 3.7);
  light_slab.uv_plane_y_mm = 500.0;
  light_slab.u = {-120.0, 110.0, 5};
  light_slab.v = {-70.0, 130.0, 4};
  SlabGeometry slab;
  slab.st_plane_y_mm = 4.0;
  slab.s = {-62.0, 60.0, 83};
  slab.t = {-50.0, 58.0, 77};
  slab.stored_s = {2, 81};
  slab.stored_t = {4, 73};
  light_slab.slabs.push_back(slab);
  return light_slab;
}

/// The same planes, cut into slabs at the given depths; all share the first slab's (s,t) lattice.
inline LightSlab cut_at(LightSlab light_slab, const std::vector<double>& boundaries_y_mm) {
  const SlabGeometry whole = light_slab.slabs.front();
  light_slab.slabs.assign(boundaries_y_mm.size() + 1, whole);
  for (std::size_t k = 0; k < boundaries_y_mm.size(); ++k) {
    light_slab.slabs[k].y_high_mm = boundaries_y_mm[k];
    light_slab.slabs[k + 1].y_low_mm = boundaries_y_mm[k];
  }
  return light_slab;
}

}  // namespace af::test
