// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <numbers>
#include <string>
#include <tuple>
#include <vector>

#include <Eigen/Geometry>

namespace af {

/// Rigid map between two frames; a variable of this type is named `a_from_b` and maps coordinates
/// of b to a (mm).
using RigidTransform = Eigen::Isometry3d;

inline constexpr double kRadPerDeg = std::numbers::pi / 180.0;
inline constexpr double kDegPerRad = 180.0 / std::numbers::pi;

/// The six parameters of a pose relative to a PoseFrame: rotations about the room's x, y, z axes
/// (rad) and translations along them (mm).
struct PoseParameters {
  Eigen::Vector3d rotation_rad = Eigen::Vector3d::Zero();
  Eigen::Vector3d translation_mm = Eigen::Vector3d::Zero();

  /// (rx, ry, rz in degrees, tx, ty, tz in mm): the order of every CSV file and report.
  [[nodiscard]] std::array<double, 6> deg_and_mm() const;
  static PoseParameters from_deg_and_mm(const std::array<double, 6>& values);
  auto members() { return std::tie(rotation_rad, translation_mm); }
};

/// Names of deg_and_mm() in files.
inline constexpr std::array<const char*, 6> kParameterNames = {
    "rx_deg", "ry_deg", "rz_deg", "tx_mm", "ty_mm", "tz_mm"};

/// What six pose parameters are relative to: the triple (R0, c, r) of
///
///     x_room = r + t + Rz(rz) Ry(ry) Rx(rx) R0 (x_ct - c)
///
/// Zero parameters give the *nominal* pose.
struct PoseFrame {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();    ///< R0, room from ct
  Eigen::Vector3d center_ct_mm = Eigen::Vector3d::Zero();    ///< c, in the ct frame
  Eigen::Vector3d center_room_mm = Eigen::Vector3d::Zero();  ///< r, in the room frame

  [[nodiscard]] RigidTransform nominal_room_from_ct() const;
  /// The frame whose zero parameters give `room_from_ct`, and whose rotations are about
  /// `center_ct_mm`.
  static PoseFrame about(const RigidTransform& room_from_ct, const Eigen::Vector3d& center_ct_mm);
};

/// Rz Ry Rx: first about x, then y, then z, all fixed room axes.
Eigen::Matrix3d rotation_from_angles(const Eigen::Vector3d& rotation_rad);

/// Inverse of rotation_from_angles; ry in [-pi/2, pi/2]. At gimbal lock rz is 0.
Eigen::Vector3d angles_from_rotation(const Eigen::Matrix3d& rotation);

RigidTransform pose_from_parameters(const PoseFrame& frame, const PoseParameters& parameters);
PoseParameters parameters_from_pose(const PoseFrame& frame, const RigidTransform& room_from_ct);

/// Small motions per unit of every pose parameter (rad, mm; columns). Motions are rotations about
/// the room's axes through r + t in rad, then translations along the axes in mm. The pose x_room =
/// r + t + Rz Ry Rx R0 (x - c) turns about r + t: by rx about Rz Ry e_x, by ry about Rz e_y, by rz
/// about e_z. \test PoseParameters.MoveThePoseAsTheirMotionsSay
Eigen::Matrix<double, 6, 6> motions_from_parameters(const PoseParameters& parameters);

/// Why the 4x4 matrix is not a rigid transform (tolerance 1e-5 on orthonormality) within 1 km;
/// empty when it is one.
std::vector<std::string> rigidity_problems(const Eigen::Matrix4d& matrix);

/// The nearest rigid transform of a matrix that passed rigidity_problems(), orthonormalised by SVD.
/// A matrix that is orthonormal to 1e-14 keeps its bits, so that written poses read back the same.
RigidTransform rigid_from_matrix(const Eigen::Matrix4d& matrix);

/// The same for any 4x4 matrix. Throws InputError that begins with `where` when it is not rigid.
RigidTransform rigid_or_throw(const Eigen::Matrix4d& matrix, const std::string& where);

/// The pose of six numbers (rx_deg ... tz_mm) relative to `frame`. Throws InputError, beginning
/// with `where`, when it is not finite or leads more than a kilometre away (rigidity_problems()).
RigidTransform pose_of_deg_and_mm(const PoseFrame& frame,
                                  const std::array<double, 6>& values,
                                  const std::string& where);

/// The smallest rotation that takes the direction of `from` to that of `to`; neither is zero.
/// Directions within 1.4e-6 rad of opposite give half a turn about a perpendicular axis.
/// Orthonormal to 1e-11.
Eigen::Matrix3d rotation_between(const Eigen::Vector3d& from, const Eigen::Vector3d& to);

/// Angle of the rotation a^-1 b, in rad.
double rotation_angle_between_rad(const RigidTransform& a, const RigidTransform& b);

}  // namespace af
