// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "geometry/camera_geometry.h"

namespace af::test {

/// A camera that looks from `source` at the room's origin, rows downwards, 512 x 512 pixels of
/// 0.4 mm; its detector stands half as far behind the origin, whose image is the middle.
inline CameraGeometry camera_at(const std::string& name,
                                const Eigen::Vector3d& source,
                                const Eigen::Vector3d& column) {
  CameraGeometry camera;
  camera.name = name;
  camera.source_point = source;
  camera.column_direction = column;
  camera.row_direction = -Eigen::Vector3d::UnitZ();
  camera.pixel_spacing_mm = {0.4, 0.4};
  camera.size_px = {512, 512};
  const double half_side_mm = 255.5 * 0.4;
  camera.detector_origin_point =
      -0.5 * source - half_side_mm * (camera.column_direction + camera.row_direction);
  return camera;
}

}  // namespace af::test
