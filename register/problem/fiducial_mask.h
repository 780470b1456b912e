// SPDX-License-Identifier: Apache-2.0
// Keeps the markers of the gold standard out of the registration that they judge.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "geometry/camera_geometry.h"
#include "xray/image2d.h"

namespace af::registration {

/// `mask` (whole detector, non-zero = used; empty: every pixel), with 0 where a pixel's centre lies
/// within `radius_px` of a fiducial's projection (column, row; NaN: the view hides it). Returns
/// `mask` itself when there is no fiducial or the radius is 0.
Image2d mask_fiducials(Image2d mask,
                       const CameraGeometry& camera,
                       const std::vector<Eigen::Vector2d>& fiducials_px,
                       double radius_px);

}  // namespace af::registration
