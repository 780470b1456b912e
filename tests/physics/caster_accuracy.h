// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "ct/attenuation_volume.h"
#include "geometry/camera_geometry.h"
#include "geometry/motion_range.h"

namespace af::test {

/// How near the shear-warp caster comes to the reference, over random rays of a field.
struct CasterAccuracy {
  double psnr_db = 0.0;            ///< eq. (12) against the reference caster at 0.1 mm
  double reference_psnr_db = 0.0;  ///< the reference at 0.2 mm against itself at 0.1 mm
  int rays = 0;                    ///< with a reference above 0
  std::size_t grid_bytes = 0;
};

/// Casts `rows` random rows of (s,t) nodes of a field with the paper's parameters, each from a
/// random viewpoint. I_max is the largest reference value among them.
CasterAccuracy measure_caster_accuracy(const AttenuationVolume& volume,
                                       const CameraGeometry& camera,
                                       const PoseFrame& frame,
                                       const MotionRange& range,
                                       int rows);

}  // namespace af::test
