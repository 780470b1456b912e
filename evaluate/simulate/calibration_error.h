// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "geometry/camera_geometry.h"
#include "geometry/ct_box.h"
#include "geometry/rigid_transform.h"

namespace af {

/// The true camera behind a wrong calibration. Its detector is moved in its plane and turned about
/// its middle, and its source is moved along the beam. The errors are drawn from independent normal
/// distributions keyed by (seed, key), and then scaled together so that the projections of the
/// box's corners move by exactly `error_px` RMS.
/// \test CalibrationError.MovesTheTargetBoxByTheStatedRms
CameraGeometry camera_with_calibration_error(const CameraGeometry& camera,
                                             const RigidTransform& room_from_ct,
                                             const CtBox& box_ct,
                                             double error_px,
                                             std::uint64_t seed,
                                             std::uint64_t key);

}  // namespace af
