// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "geometry/camera_geometry.h"
#include "geometry/rigid_transform.h"

namespace af {

/// Where one camera saw the landmarks: (column, row), in the order of the CT's landmarks; nullopt
/// where it did not.
struct LandmarkView {
  CameraGeometry camera;
  std::vector<std::optional<Eigen::Vector2d>> landmarks_px;
};

/// How far a placed landmark is from where one view saw it.
struct LandmarkResidual {
  std::size_t landmark = 0;  ///< index
  std::size_t view = 0;      ///< index
  double px = 0.0;           ///< on the detector, in its pixels (columns and rows by themselves)
  double mm = 0.0;           ///< of the landmark from the ray, at its place
};

/// A pose from landmarks.
struct LandmarkPose {
  RigidTransform room_from_ct = RigidTransform::Identity();
  std::vector<LandmarkResidual> residuals;
  double rms_px = 0.0;
  double rms_mm = 0.0;
  /// How it was found, and what had to be chosen: "3 landmarks in 1 view leave 2 poses; ...".
  std::vector<std::string> notes;
};

/// The pose with the least sum of squared distances on the detectors (mm) between the landmarks as
/// the views saw them and as the cameras project them, found by Levenberg-Marquardt from the
/// triangulated points (seen in two views or more; Arun et al. 1987) and from 96 rotations over all
/// of SO(3), each with the translation that brings the points nearest to their rays. Poses that fit
/// about as well (as three points in one view have up to four, and points near a plane two) are
/// told apart by `nominal_room_from_ct`: the one turned least from it is taken, and a note says so.
/// InputError: fewer than three different landmarks are seen, those are on one line, counts differ,
/// or no pose puts them before the cameras.
/// \test LandmarkPose.OfOneViewAndFourPointsIsTheTrueOne
LandmarkPose pose_from_landmarks(std::span<const LandmarkView> views,
                                 std::span<const Eigen::Vector3d> landmarks_ct_mm,
                                 const RigidTransform& nominal_room_from_ct);

}  // namespace af
