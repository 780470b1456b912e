// SPDX-License-Identifier: Apache-2.0
// Where DiffDRR's camera stands (as of its commit 799ca1e; docs/poses.md says what is known of its
// releases). Its frame: the source at the origin, the beam along +z, x against the columns, y
// against the rows.
#pragma once

#include <string>
#include <vector>

#include "geometry/camera_geometry.h"
#include "geometry/rigid_transform.h"

namespace af {

/// DiffDRR's numbers of one pose.
struct DiffDrrPose {
  std::string parameterization = "euler_angles";  ///< or "quaternion" (real part first)
  std::string convention = "ZXY";                 ///< of Euler angles
  std::vector<double> rotation;                   ///< rad, or the quaternion
  Eigen::Vector3d translation_mm = Eigen::Vector3d::Zero();
  std::string orientation = "AP";  ///< of its Subject: "AP", "PA" or "none"
};

/// A member of a DiffDrrPose that no DRR can be made with, and what it must be.
struct DiffDrrProblem {
  std::string member;  ///< "parameterization", "convention", "orientation" or "rotation"
  std::string constraint;
};

/// DiffDRR's world (RAS axes, the middle of the volume at the origin; mm) from its camera: R0 turns
/// the camera to its orientation, then x -> R (R0 x + t). The source is at the camera's origin, the
/// beam goes along +z.
RigidTransform world_from_diffdrr_camera(const DiffDrrPose& pose);

/// What is wrong with a pose's words and numbers: the member and what it must be; empty when
/// nothing is.
std::vector<DiffDrrProblem> problems(const DiffDrrPose& pose);

/// DiffDRR's world from LPS axes (mm) that have the middle of the volume at `middle_mm`.
RigidTransform diffdrr_world_from_lps(const Eigen::Vector3d& middle_mm);

/// Room from DiffDRR's camera: its x is against the columns (DRR with reverse_x_axis=True, the
/// default), along them for a mirrored camera (False); its y is against the rows, its z along the
/// beam.
RigidTransform room_from_diffdrr_camera(const CameraGeometry& camera);

/// Angles of R = R_a(angle 0) R_b(angle 1) R_c(angle 2), a b c the letters of `convention`, all
/// different; rad.
Eigen::Vector3d angles_of_convention(const Eigen::Matrix3d& rotation,
                                     const std::string& convention);

/// The pose, in Euler angles "ZXY" and the orientation "AP", that puts the camera there.
DiffDrrPose diffdrr_pose_of(const RigidTransform& world_from_camera);
}  // namespace af
