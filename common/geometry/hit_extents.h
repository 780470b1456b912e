// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include "geometry/slab_sizing.h"

namespace af {

/// Like extents_on_planes(), without the margin: what planes must hold, not how large they are
/// made.
std::vector<PlaneExtent> hit_extents(const CameraGeometry& camera,
                                     const PoseFrame& frame,
                                     const MotionRange& range,
                                     std::span<const double> plane_y_mm,
                                     const RigidTransform& slab_from_ct);

}  // namespace af
