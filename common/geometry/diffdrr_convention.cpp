// SPDX-License-Identifier: Apache-2.0
#include "geometry/diffdrr_convention.h"

#include <cmath>

#include <Eigen/Geometry>

#include "base/error.h"

namespace af {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

Matrix3d rotation_about_letter(char letter, double angle_rad) {
  return Eigen::AngleAxisd(angle_rad, Vector3d::Unit(letter - 'X')).toRotationMatrix();
}

/// World from camera before any turn.
Matrix3d orientation_rotation(const std::string& orientation) {
  Matrix3d rotation = Matrix3d::Identity();
  if (orientation == "AP") rotation << 1, 0, 0, 0, 0, -1, 0, 1, 0;
  if (orientation == "PA") rotation << -1, 0, 0, 0, 0, 1, 0, 1, 0;
  return rotation;
}

Matrix3d rotation_of(const DiffDrrPose& pose) {
  const std::vector<double>& r = pose.rotation;
  if (pose.parameterization == "quaternion")
    return Eigen::Quaterniond(r[0], r[1], r[2], r[3]).normalized().toRotationMatrix();
  Matrix3d rotation = Matrix3d::Identity();
  for (std::size_t i = 0; i < 3; ++i)
    rotation = rotation * rotation_about_letter(pose.convention[i], r[i]);
  return rotation;
}

/// Three of X, Y and Z, neighbours different.
bool is_convention(const std::string& letters) {
  return letters.size() == 3 && letters.find_first_not_of("XYZ") == std::string::npos &&
         letters[0] != letters[1] && letters[1] != letters[2];
}

}  // namespace

RigidTransform world_from_diffdrr_camera(const DiffDrrPose& pose) {
  const Matrix3d rotation = rotation_of(pose);
  RigidTransform world_from_camera = RigidTransform::Identity();
  world_from_camera.linear() = rotation * orientation_rotation(pose.orientation);
  world_from_camera.translation() = rotation * pose.translation_mm;
  return world_from_camera;
}

std::vector<DiffDrrProblem> problems(const DiffDrrPose& pose) {
  constexpr double kNormTolerance = 1e-5;
  std::vector<DiffDrrProblem> found;
  const bool is_quaternion = pose.parameterization == "quaternion";
  if (!is_quaternion && pose.parameterization != "euler_angles")
    found.push_back({"parameterization", "must be \"euler_angles\" or \"quaternion\""});
  if (!is_quaternion && !is_convention(pose.convention))
    found.push_back({"convention", "must be three of X, Y and Z, neighbours different"});
  if (pose.orientation != "AP" && pose.orientation != "PA" && pose.orientation != "none")
    found.push_back({"orientation", "must be \"AP\", \"PA\" or \"none\""});
  double square = 0.0;
  for (const double value : pose.rotation) square += value * value;
  if (is_quaternion && !pose.rotation.empty() &&
      !(std::abs(std::sqrt(square) - 1.0) <= kNormTolerance))
    found.push_back({"rotation", "must be a quaternion of norm 1, real part first"});
  return found;
}

RigidTransform diffdrr_world_from_lps(const Vector3d& middle_mm) {
  RigidTransform world_from_lps = RigidTransform::Identity();
  world_from_lps.linear() = Vector3d(-1.0, -1.0, 1.0).asDiagonal();
  world_from_lps.translation() = -(world_from_lps.linear() * middle_mm);
  return world_from_lps;
}

RigidTransform room_from_diffdrr_camera(const CameraGeometry& camera) {
  RigidTransform room_from_camera = RigidTransform::Identity();
  room_from_camera.linear().col(0) = (camera.is_mirrored() ? 1.0 : -1.0) * camera.column_direction;
  room_from_camera.linear().col(1) = -camera.row_direction;
  room_from_camera.linear().col(2) = camera.beam_direction();
  room_from_camera.translation() = camera.source_point;
  return room_from_camera;
}

Vector3d angles_of_convention(const Matrix3d& rotation, const std::string& convention) {
  check(is_convention(convention) && convention[0] != convention[2], "three different axes");
  const int a = convention[0] - 'X';
  const int b = convention[1] - 'X';
  const int c = convention[2] - 'X';
  const double sign = (b - a + 3) % 3 == 1 ? 1.0 : -1.0;
  // R = Ra Rb Rc: column c of it is that of Ra Rb, whose length beside Ra's axis is the cosine of
  // the middle angle. Where that is nothing but rounding (gimbal lock), first and last turn about
  // one line: the last takes all of it. The other two angles are of what remains when the first is
  // taken off, so that a first angle which is poorly known there costs nothing.
  constexpr double kLocked = 1e-15;
  const bool is_locked = std::hypot(rotation(b, c), rotation(c, c)) < kLocked;
  const double first = is_locked ? 0.0 : std::atan2(-sign * rotation(b, c), rotation(c, c));
  const Matrix3d rest =
      rotation_about_letter(convention[0], first).transpose() * rotation;  // Rb Rc
  const double middle = std::atan2(sign * rest(a, c), rest(c, c));
  const double last = std::atan2(sign * rest(b, a), rest(b, b));
  return {first, middle, last};
}

DiffDrrPose diffdrr_pose_of(const RigidTransform& world_from_camera) {
  DiffDrrPose pose;
  const Matrix3d rotation =
      world_from_camera.linear() * orientation_rotation(pose.orientation).transpose();
  const Vector3d angles = angles_of_convention(rotation, pose.convention);
  pose.rotation.assign(angles.begin(), angles.end());
  pose.translation_mm = rotation.transpose() * world_from_camera.translation();
  return pose;
}

}  // namespace af
