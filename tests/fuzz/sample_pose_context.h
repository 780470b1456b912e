// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "geometry/camera_geometry.h"
#include "pose_files/pose_format.h"

namespace af::fuzz {

/// A CT, a camera and a frame, for formats of poses that are relative to them.
PoseContext sample_pose_context();

}  // namespace af::fuzz
