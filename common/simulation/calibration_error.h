// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "geometry/camera_geometry.h"
#include "geometry/rigid_transform.h"
#include "geometry/slab_sizing.h"

namespace af {

/// The camera as it truly stands when calibration missed it: moved detector (in its plane, turned
/// about its middle) and source (along the beam), drawn with independent normal errors keyed by
/// (seed, key), then scaled together so that the projections of the box's corners move by exactly
/// `error_px` RMS. \test CalibrationError.MovesTheTargetBoxByTheStatedRms
CameraGeometry camera_with_calibration_error(const CameraGeometry& camera,
                                             const RigidTransform& room_from_ct,
                                             const CtBox& box_ct,
                                             double error_px,
                                             std::uint64_t seed,
                                             std::uint64_t key);

}  // namespace af
