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

/// How far a placed landmark lies from where one view saw it.
struct LandmarkResidual {
  std::size_t landmark = 0;  ///< index
  std::size_t view = 0;      ///< index
  double px = 0.0;  ///< on the detector, in its pixels (columns and rows scaled separately)
  double mm = 0.0;  ///< from the landmark to the ray, at the landmark's depth
};

/// A pose from landmarks.
struct LandmarkPose {
  RigidTransform room_from_ct = RigidTransform::Identity();
  std::vector<LandmarkResidual> residuals;
  double rms_px = 0.0;
  double rms_mm = 0.0;
  /// How the pose was found, and what had to be chosen: "3 landmarks in 1 view leave 2 poses; ...".
  std::vector<std::string> notes;
};

/// The pose with the least sum of squared distances (mm on the detectors) between the landmarks
/// that the views saw and their projections. Levenberg-Marquardt finds it from several starts: the
/// triangulated points (seen in two views or more; Arun et al. 1987), and 96 rotations over all of
/// SO(3), each with the translation that brings the points nearest to their rays.
/// Several poses may fit about as well: three points in one view have up to four, points near a
/// plane two. The pose turned least from `nominal_room_from_ct` is then taken, and a note says so.
/// Throws InputError when fewer than three different landmarks are seen, when those are on one
/// line, when counts differ, or when no pose puts them in front of the cameras.
/// \test LandmarkPose.OfOneViewAndFourPointsIsTheTrueOne
LandmarkPose pose_from_landmarks(std::span<const LandmarkView> views,
                                 std::span<const Eigen::Vector3d> landmarks_ct_mm,
                                 const RigidTransform& nominal_room_from_ct);

}  // namespace af
