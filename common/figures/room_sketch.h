// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "ct/ct_volume.h"
#include "figures/picture.h"
#include "geometry/camera_geometry.h"
#include "geometry/rigid_transform.h"

namespace af {

/// Sources, detectors, the outlines of the beams and the CT's box with the patient's letters on its
/// faces, seen along three directions: obliquely, from above the head end of the room's z axis, and
/// along its y axis. The scale is that of detectors and CT, so sources may lie off the paper.
std::vector<PicturePanel> room_sketch(std::span<const CameraGeometry> cameras,
                                      const CtGrid& ct,
                                      const RigidTransform& room_from_ct);

}  // namespace af
