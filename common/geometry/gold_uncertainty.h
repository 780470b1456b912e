// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "geometry/fiducial_registration.h"

namespace af {

/// How far the fiducials' gold pose may itself lie from the true pose, as a TRE over the target.
struct GoldUncertainty {
  /// Degrees of freedom of the residuals that give the noise of detections: two for each fiducial
  /// in each view that shows it, less the six parameters of the pose. The relative standard error
  /// of `detection_sigma_px` is 1 / sqrt(2 * degrees_of_freedom): 0.22 for four fiducials in two
  /// views.
  std::size_t degrees_of_freedom = 0;
  double detection_sigma_px = 0.0;  ///< per coordinate of a detection, from the residuals
  std::size_t replicates = 0;
  double mean_tre_mm = 0.0;  ///< over replicates: what the gold standard adds to a TRE by itself
  double rms_tre_mm = 0.0;
  double p95_tre_mm = 0.0;
};

inline constexpr std::size_t kGoldReplicates = 1000;

/// Monte Carlo on the measured residuals. The gold pose projects the CT's fiducials into every
/// view, and the detections' distances from there are the residuals. Their variance (per degree of
/// freedom) is that of a detection, and includes the error of localising fiducials in the CT. Each
/// replicate adds normal noise of that variance to the projections, makes the gold standard again
/// from back-projection on, and takes the mean TRE between it and the gold pose. The result depends
/// on the arguments alone. A replicate whose noise leaves no pose is infinitely far. Throws
/// InputError without target points.
/// \test GoldUncertainty.EqualsTheTrueErrorOfSimulatedGoldStandards
GoldUncertainty gold_uncertainty(const FiducialGold& gold,
                                 std::span<const FiducialView> views,
                                 std::span<const Eigen::Vector3d> fiducials_ct_mm,
                                 std::span<const Eigen::Vector3d> target_points_ct_mm,
                                 std::uint64_t seed,
                                 std::size_t replicates = kGoldReplicates);

}  // namespace af
