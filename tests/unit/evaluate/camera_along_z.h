// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "geometry/camera_geometry.h"

namespace af::test {

/// A camera whose source stands 600 mm in front of the room's origin on the z axis and whose
/// detector is 400 mm behind it: what lies at the origin is magnified 1000 / 600 times. Pixels of
/// 0.5 mm, columns along x, rows along y.
inline CameraGeometry camera_along_z() {
  CameraGeometry camera;
  camera.name = "Z";
  camera.source_point = {0, 0, -600};
  camera.detector_origin_point = {-100, -100, 400};
  camera.pixel_spacing_mm = {0.5, 0.5};
  camera.size_px = {401, 401};
  return camera;
}

}  // namespace af::test
