// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "evaluate/scan/scan_geometry.h"

namespace af::test {

/// Distance from camera to camera on the detector when one object is seen by both, px (root mean
/// square over points of a cylinder about the axis and the scan's angles), after the rigid motion
/// and the change of size of the object that make it smallest: projections do not tell where an
/// object lies and how large it is. Two calibrations are one when this is 0.
double calibration_distance_px(const CircularScan& scan,
                               const ScanCalibration& a,
                               const ScanCalibration& b,
                               double radius_mm,
                               double half_height_mm);

}  // namespace af::test
