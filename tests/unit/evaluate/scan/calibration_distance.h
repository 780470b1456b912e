// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "evaluate/scan/scan_geometry.h"

namespace af::test {

/// How far apart two calibrations project one object on the detector, px: the root mean square over
/// points of a cylinder about the axis and over the scan's angles. Projections do not tell where an
/// object lies or how large it is, so the rigid motion and the scaling that make the distance
/// smallest are applied first. Equivalent calibrations have distance 0.
double calibration_distance_px(const CircularScan& scan,
                               const ScanCalibration& a,
                               const ScanCalibration& b,
                               double radius_mm,
                               double half_height_mm);

}  // namespace af::test
