// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <limits>
#include <tuple>

#include "register/verdict/target_evidence.h"

namespace af::registration {

/// What a registration says about its own error. It holds only numbers, because millions are kept
/// in memory. NaN where it cannot be said.
struct UncertaintyReport {
  static constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  static constexpr std::size_t kCovarianceSize = 21;

  /// Upper triangle, row by row, of the covariance of (rx, ry, rz, tx, ty, tz) in deg and mm. The
  /// true pose is the found pose followed by x_room -> p + t + Rz Ry Rx (x_room - p), about the
  /// room's axes, where p is the ROI centre at the found pose.
  std::array<double, kCovarianceSize> covariance_deg_mm = filled_with_nan();
  double tre_rms_mm = kNone;  ///< the root of the expected mean squared TRE over the target box
  double sandwich_tre_mm = kNone;  ///< rms, from the sandwich alone; the confidence uses it
  double tre_95_mm = kNone;        ///< the TRE is below this with probability 0.95
  /// With one view: the target's centre lies within this distance, to either side, along the beam
  /// with probability 0.95.
  double depth_95_mm = kNone;
  TargetEvidence target;         ///< for an end that is found if its target agrees
  double inflation = kNone;      ///< what calibration multiplied the sandwich by for the covariance
  double tre_inflation = kNone;  ///< likewise for the TREs
  /// Probability that the registration succeeded (success_confidence(), or
  /// confidence_if_target_agrees() with a target that agrees). It is a lower bound where tre_rms_mm
  /// is NaN, and 0 where there is no end.
  double confidence = kNone;

  auto members() {
    return std::tie(covariance_deg_mm,
                    tre_rms_mm,
                    sandwich_tre_mm,
                    tre_95_mm,
                    depth_95_mm,
                    target,
                    inflation,
                    tre_inflation,
                    confidence);
  }

 private:
  static constexpr std::array<double, kCovarianceSize> filled_with_nan() {
    std::array<double, kCovarianceSize> values{};
    for (double& value : values) value = kNone;
    return values;
  }
};

}  // namespace af::registration
