// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "drr/ray_cast_drr.h"
#include "register/problem/pose_target.h"
#include "register/verdict/registration.h"
#include "support/ct_phantoms.h"

namespace af::test {

/// A camera of 48 x 48 pixels of 3 mm, 650 mm from source to isocentre and 1000 mm to the detector,
/// looking along +y (`turned` false) or along -x.
inline CameraGeometry small_camera(bool turned) {
  CameraGeometry camera;
  constexpr double kHalfSideMm = 47 * 3.0 / 2.0;
  camera.name = turned ? "LAT" : "AP";
  camera.source_point = turned ? Eigen::Vector3d(650, 0, 0) : Eigen::Vector3d(0, -650, 0);
  camera.detector_origin_point = turned ? Eigen::Vector3d(-350, -kHalfSideMm, kHalfSideMm)
                                        : Eigen::Vector3d(-kHalfSideMm, 350, kHalfSideMm);
  camera.column_direction = turned ? Eigen::Vector3d::UnitY() : Eigen::Vector3d::UnitX();
  camera.row_direction = -Eigen::Vector3d::UnitZ();
  camera.pixel_spacing_mm = {3.0, 3.0};
  camera.size_px = {48, 48};
  return camera;
}

/// Five ellipsoids without symmetry in 96 mm of air, 3 mm voxels.
inline CtVolume five_ellipsoids() {
  CtGrid grid;
  grid.size = {32, 32, 32};
  grid.spacing_mm = {3, 3, 3};
  grid.origin_mm = {-46.5, -46.5, -46.5};
  return ellipsoid_phantom(grid,
                           {{{0, 0, 0}, {38, 30, 34}, Eigen::Matrix3d::Identity(), 0},
                            {{12, -8, 10}, {9, 6, 14}, Eigen::Matrix3d::Identity(), 900},
                            {{-14, 9, -6}, {7, 12, 8}, Eigen::Matrix3d::Identity(), 700},
                            {{4, 12, -18}, {14, 5, 5}, Eigen::Matrix3d::Identity(), 1100},
                            {{-9, -12, 15}, {6, 8, 5}, Eigen::Matrix3d::Identity(), 500}},
                           2);
}

/// Bones without soft tissue, all towards one corner: no mirror image of a view looks like it.
inline CtVolume bones_in_a_corner() {
  return ellipsoid_phantom(five_ellipsoids().grid,
                           {{{12, -8, 20}, {9, 6, 14}, Eigen::Matrix3d::Identity(), 900},
                            {{-4, 19, 6}, {7, 12, 8}, Eigen::Matrix3d::Identity(), 700},
                            {{22, 12, -12}, {14, 5, 5}, Eigen::Matrix3d::Identity(), 1100},
                            {{1, 2, 30}, {6, 8, 5}, Eigen::Matrix3d::Identity(), 800}},
                           2);
}

/// The CT with so many more voxels of air on every side.
inline CtVolume in_air(const CtVolume& ct, int voxels) {
  CtGrid grid = ct.grid;
  grid.origin_mm = ct.grid.point_mm(Eigen::Vector3d::Constant(-voxels));
  for (int& size : grid.size) size += 2 * voxels;
  std::vector<std::int16_t> hu(grid.voxel_count(), -1000);
  const auto at = [](const CtGrid& of, int j, int k) {
    return static_cast<std::ptrdiff_t>(of.size[0]) * (k * of.size[1] + j);
  };
  for (int k = 0; k < ct.grid.size[2]; ++k)
    for (int j = 0; j < ct.grid.size[1]; ++j)
      std::copy_n(ct.hu.data() + at(ct.grid, j, k),
                  ct.grid.size[0],
                  hu.begin() + at(grid, j + voxels, k + voxels) + voxels);
  return {grid, SharedArray<std::int16_t>(std::move(hu))};
}

struct SmallCase {
  std::shared_ptr<registration::RegistrationProblem> problem;
  RigidTransform gold_room_from_ct;
};

/// Two views of a CT; the X-rays are DRRs at the gold pose, made by the same ray caster.
inline SmallCase small_case(const CtVolume& ct = five_ellipsoids()) {
  const auto volume = std::make_shared<const AttenuationVolume>(ct, AttenuationModel{});
  const auto renderer = std::make_shared<const RayCastDrr>(volume, RayCasterOptions{2.0});
  SmallCase small;
  small.problem = std::make_shared<registration::RegistrationProblem>();
  small.problem->scaling_points_ct = registration::ct_lattice_points(ct.grid);
  const PoseFrame frame = small.problem->frame();
  small.gold_room_from_ct = pose_from_parameters(
      frame, PoseParameters::from_deg_and_mm({1.5, -2.0, 1.0, 2.5, -1.5, 2.0}));
  for (const bool turned : {false, true}) {
    registration::RegistrationView view;
    view.view = {small_camera(turned), {6, 6, 36, 36}};
    view.renderer = renderer;
    view.xray =
        render_image(*renderer, small.gold_room_from_ct, View::whole_detector(view.view.camera));
    small.problem->views.push_back(view);
  }
  return small;
}

}  // namespace af::test
