// SPDX-License-Identifier: Apache-2.0
#include "geometry/rigid_transform.h"

#include <cmath>
#include <numbers>

#include "base/error.h"
#include "base/plausible.h"

namespace af {

namespace {

/// Largest element of |R^T R - I|.
double orthonormality_error(const Eigen::Matrix3d& rotation) {
  return (rotation.transpose() * rotation - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
}

}  // namespace

std::array<double, 6> PoseParameters::deg_and_mm() const {
  return {rotation_rad.x() * kDegPerRad,
          rotation_rad.y() * kDegPerRad,
          rotation_rad.z() * kDegPerRad,
          translation_mm.x(),
          translation_mm.y(),
          translation_mm.z()};
}

PoseParameters PoseParameters::from_deg_and_mm(const std::array<double, 6>& values) {
  PoseParameters parameters;
  parameters.rotation_rad = Eigen::Vector3d(values[0], values[1], values[2]) * kRadPerDeg;
  parameters.translation_mm = Eigen::Vector3d(values[3], values[4], values[5]);
  return parameters;
}

RigidTransform PoseFrame::nominal_room_from_ct() const {
  return pose_from_parameters(*this, PoseParameters{});
}

PoseFrame PoseFrame::about(const RigidTransform& room_from_ct,
                           const Eigen::Vector3d& center_ct_mm) {
  return {room_from_ct.linear(), center_ct_mm, room_from_ct * center_ct_mm};
}

Eigen::Matrix3d rotation_from_angles(const Eigen::Vector3d& rotation_rad) {
  using Eigen::AngleAxisd;
  using Eigen::Vector3d;
  return (AngleAxisd(rotation_rad.z(), Vector3d::UnitZ()) *
          AngleAxisd(rotation_rad.y(), Vector3d::UnitY()) *
          AngleAxisd(rotation_rad.x(), Vector3d::UnitX()))
      .toRotationMatrix();
}

Eigen::Vector3d angles_from_rotation(const Eigen::Matrix3d& rotation) {
  const double cos_y = std::hypot(rotation(0, 0), rotation(1, 0));
  const double angle_y = std::atan2(-rotation(2, 0), cos_y);
  constexpr double kGimbalLock = 1e-12;
  const double angle_z = cos_y < kGimbalLock ? 0.0 : std::atan2(rotation(1, 0), rotation(0, 0));
  // rx comes from what is left after rz: Rz^-1 R = Ry Rx. Near gimbal lock rz is ill-determined,
  // and this rx corrects its error.
  const double sin_z = std::sin(angle_z);
  const double cos_z = std::cos(angle_z);
  const double angle_x = std::atan2(sin_z * rotation(0, 2) - cos_z * rotation(1, 2),
                                    cos_z * rotation(1, 1) - sin_z * rotation(0, 1));
  return {angle_x, angle_y, angle_z};
}

RigidTransform pose_from_parameters(const PoseFrame& frame, const PoseParameters& parameters) {
  RigidTransform room_from_ct = RigidTransform::Identity();
  room_from_ct.linear() = rotation_from_angles(parameters.rotation_rad) * frame.rotation;
  room_from_ct.translation() =
      frame.center_room_mm + parameters.translation_mm - room_from_ct.linear() * frame.center_ct_mm;
  return room_from_ct;
}

PoseParameters parameters_from_pose(const PoseFrame& frame, const RigidTransform& room_from_ct) {
  PoseParameters parameters;
  parameters.rotation_rad =
      angles_from_rotation(room_from_ct.linear() * frame.rotation.transpose());
  parameters.translation_mm = room_from_ct * frame.center_ct_mm - frame.center_room_mm;
  return parameters;
}

Eigen::Matrix<double, 6, 6> motions_from_parameters(const PoseParameters& parameters) {
  const auto about = [](int axis, double angle_rad) {
    Eigen::Vector3d angles = Eigen::Vector3d::Zero();
    angles[axis] = angle_rad;
    return rotation_from_angles(angles);
  };
  const Eigen::Matrix3d about_z = about(2, parameters.rotation_rad.z());
  Eigen::Matrix<double, 6, 6> motions = Eigen::Matrix<double, 6, 6>::Identity();
  motions.block<3, 1>(0, 0) =
      about_z * about(1, parameters.rotation_rad.y()) * Eigen::Vector3d::UnitX();
  motions.block<3, 1>(0, 1) = about_z * Eigen::Vector3d::UnitY();
  return motions;
}

std::vector<std::string> rigidity_problems(const Eigen::Matrix4d& matrix) {
  constexpr double kTolerance = 1e-5;
  std::vector<std::string> problems;
  if (!matrix.allFinite()) return {"pose has values that are not finite"};
  if (!(matrix.topRightCorner<3, 1>().cwiseAbs().maxCoeff() <= kMaxRoomMm))
    problems.push_back(std::string("the pose's translation ") + kPlausibleRoom);
  if (!(matrix.row(3) - Eigen::RowVector4d(0, 0, 0, 1)).isZero(kTolerance))
    problems.emplace_back("the pose's last row must be 0 0 0 1");
  const Eigen::Matrix3d rotation = matrix.topLeftCorner<3, 3>();
  const double deviation = orthonormality_error(rotation);
  if (!(deviation <= kTolerance))
    problems.push_back("the pose is not rigid: its rotation part deviates from orthonormal by " +
                       std::to_string(deviation));
  else if (!(rotation.determinant() > 0.0))
    problems.emplace_back(
        "the pose is not rigid: its rotation part is a reflection (determinant -1)");
  return problems;
}

RigidTransform rigid_from_matrix(const Eigen::Matrix4d& matrix) {
  const Eigen::Matrix3d rotation = matrix.topLeftCorner<3, 3>();
  RigidTransform transform = RigidTransform::Identity();
  transform.linear() = rotation;
  transform.translation() = matrix.topRightCorner<3, 1>();
  constexpr double kRounding = 1e-14;
  if (orthonormality_error(rotation) <= kRounding) return transform;
  const Eigen::JacobiSVD<Eigen::Matrix3d, Eigen::NoQRPreconditioner> svd(
      rotation, Eigen::ComputeFullU | Eigen::ComputeFullV);
  transform.linear() = svd.matrixU() * svd.matrixV().transpose();
  return transform;
}

RigidTransform rigid_or_throw(const Eigen::Matrix4d& matrix, const std::string& where) {
  throw_if_any(rigidity_problems(matrix), where);
  return rigid_from_matrix(matrix);
}

RigidTransform pose_of_deg_and_mm(const PoseFrame& frame,
                                  const std::array<double, 6>& values,
                                  const std::string& where) {
  const RigidTransform pose = pose_from_parameters(frame, PoseParameters::from_deg_and_mm(values));
  return rigid_or_throw(pose.matrix(), where);
}

Eigen::Matrix3d rotation_between(const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
  // Eigen's FromTwoVectors has an SVD for opposite vectors, which takes 6 s to compile.
  const Eigen::Vector3d a = from.normalized();
  const Eigen::Vector3d b = to.normalized();
  const double cosine = a.dot(b);
  constexpr double kOpposite = -1.0 + 1e-12;
  if (cosine < kOpposite)
    return Eigen::AngleAxisd(std::numbers::pi, a.unitOrthogonal()).toRotationMatrix();
  const double twice_w = std::sqrt((1.0 + cosine) * 2.0);
  Eigen::Quaterniond rotation;
  rotation.vec() = a.cross(b) * (1.0 / twice_w);
  rotation.w() = twice_w * 0.5;
  if (1.0 + cosine < 1e-3) rotation.normalize();  // the sum has lost digits
  return rotation.toRotationMatrix();
}

double rotation_angle_between_rad(const RigidTransform& a, const RigidTransform& b) {
  return std::abs(Eigen::AngleAxisd(Eigen::Matrix3d(a.linear().transpose() * b.linear())).angle());
}

}  // namespace af
