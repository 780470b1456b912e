// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "evaluate/scan/self_calibration.h"

namespace af::test {

/// A ball of constant attenuation, in the frame of the object.
struct Ball {
  Eigen::Vector3d center_mm;
  double radius_mm;
  double mu_per_mm;
};

/// Balls that no turn or mirror takes to each other, within 20 mm of the origin.
std::vector<Ball> lopsided_balls();

/// 120 views of a small detector all the way round, 3 degrees apart.
CircularScan small_scan(AxisAlong axis_along = AxisAlong::Rows, double step_deg = 3.0);

/// The exact line integrals of balls on a camera's pixels (means of 2 x 2 rays).
Image2d ball_image(const CameraGeometry& camera, const std::vector<Ball>& balls);

/// All views by the true geometry.
ScanImages simulated_scan(const CircularScan& scan,
                          const ScanCalibration& truth,
                          const std::vector<Ball>& balls);

}  // namespace af::test
