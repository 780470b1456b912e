// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "geometry/camera_geometry.h"
#include "geometry/rigid_transform.h"

namespace af::test {

/// The camera of a C-arm that looks along +y: its source is 650 mm before the room's origin. Its
/// detector is 370 mm behind, centred, with columns along x and rows along -z.
inline CameraGeometry c_arm_camera(int columns, int rows, double spacing_mm) {
  CameraGeometry camera;
  camera.name = "AP";
  camera.source_point = {0.0, -650.0, 0.0};
  camera.column_direction = {1.0, 0.0, 0.0};
  camera.row_direction = {0.0, 0.0, -1.0};
  camera.pixel_spacing_mm = {spacing_mm, spacing_mm};
  camera.size_px = {columns, rows};
  camera.detector_origin_point = {
      -0.5 * spacing_mm * (columns - 1), 370.0, 0.5 * spacing_mm * (rows - 1)};
  return camera;
}

/// The paper's camera: 12-inch C-arm, f = 650 mm, square detector whose outer edges span 2 * 152.4
/// mm at 1020 mm.
inline CameraGeometry paper_camera() {
  return c_arm_camera(256, 256, 1.190625);
}

/// The camera turned about the room's origin, then shifted.
inline CameraGeometry moved_camera(const CameraGeometry& camera,
                                   const Eigen::Matrix3d& turn,
                                   const Eigen::Vector3d& shift_mm) {
  CameraGeometry moved = camera;
  moved.source_point = turn * camera.source_point + shift_mm;
  moved.detector_origin_point = turn * camera.detector_origin_point + shift_mm;
  moved.column_direction = turn * camera.column_direction;
  moved.row_direction = turn * camera.row_direction;
  return moved;
}

}  // namespace af::test
