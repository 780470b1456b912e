// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <limits>
#include <span>
#include <tuple>

#include "geometry/camera_geometry.h"
#include "geometry/rigid_transform.h"

namespace af::evaluation {

/// How far a pose T lies from the gold pose G, besides its mean TRE (tre.h). Means are over target
/// points p and over cameras. docs/errors.md has the formulas and their sources.
struct RegistrationErrors {
  static constexpr double kMissing = std::numeric_limits<double>::quiet_NaN();

  /// Reprojection distance: from G p to the line through the source and T p (van de Kraats 2005).
  double mrpd_mm = kMissing;
  double projection_detector_mm = kMissing;   ///< distance between both projections on the detector
  double projection_isocenter_mm = kMissing;  ///< the same on the plane through the isocentre
  double rotation_deg = kMissing;             ///< angle of the rotation between the two poses
  double translation_mm = kMissing;  ///< distance between T c and G c, where c is the ROI centre
  /// How far T moves the target's centre along the beam (from source to centre by G), signed. One
  /// view hardly shows this. NaN with more views.
  double depth_mm = kMissing;

  /// Errors that exist for any number of views, in the order of columns.
  [[nodiscard]] std::array<double, 5> values() const {
    return {mrpd_mm, projection_detector_mm, projection_isocenter_mm, rotation_deg, translation_mm};
  }
  auto members() {
    return std::tie(mrpd_mm,
                    projection_detector_mm,
                    projection_isocenter_mm,
                    rotation_deg,
                    translation_mm,
                    depth_mm);
  }
};

/// The errors of `room_from_ct`. Projections are NaN when a point lies behind a source. Throws
/// InputError without points or cameras.
/// \test RegistrationErrors.OfHandComputedCases
RegistrationErrors registration_errors(const RigidTransform& room_from_ct,
                                       const RigidTransform& gold_room_from_ct,
                                       std::span<const Eigen::Vector3d> points_ct_mm,
                                       const Eigen::Vector3d& center_ct_mm,
                                       const CameraRig& rig);

}  // namespace af::evaluation
