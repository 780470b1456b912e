// SPDX-License-Identifier: Apache-2.0
#include "pose_files/diffdrr_pose.h"

#include <cmath>

#include "base/error.h"
#include "base/toml_text.h"
#include "text/toml_reader.h"

namespace af {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr const char* kMarkKey = "diffdrr_parameterization";

bool is_convention(const std::string& letters) {
  return letters.size() == 3 && letters.find_first_not_of("XYZ") == std::string::npos &&
         letters[0] != letters[1] && letters[1] != letters[2];
}

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

/// DiffDRR's world from ct: to RAS axes about the middle of the volume.
RigidTransform world_from_ct(const Vector3d& middle_ct_mm) {
  RigidTransform world_from_ct = RigidTransform::Identity();
  world_from_ct.linear() = Vector3d(-1.0, -1.0, 1.0).asDiagonal();
  world_from_ct.translation() = -(world_from_ct.linear() * middle_ct_mm);
  return world_from_ct;
}

CameraRig rig_of(const PoseContext& context, const std::string& file) {
  if (!context.rig)
    throw InputError(file + ": DiffDRR's pose is of a camera; name its rig (--rig, or --study)");
  return context.rig();
}

Vector3d middle_of(const PoseContext& context, const std::string& file) {
  if (!context.ct_grid)
    throw InputError(file +
                     ": DiffDRR's pose is about the middle of the CT; state volume_middle_ct_mm, "
                     "or name the CT (--ct, or --study)");
  return context.ct_grid().center_mm();
}

/// The only one, where none is named.
CameraGeometry camera_of(const CameraRig& rig, const std::string& name, const std::string& file) {
  if (!name.empty()) return rig.camera(name);
  if (rig.cameras.size() != 1)
    throw InputError(file + ": which camera is not said, and the rig has several (--camera)");
  return rig.cameras.front();
}

void check_pose(TomlTableReader& reader, const DiffDrrPose& pose) {
  if (pose.parameterization != "euler_angles" && pose.parameterization != "quaternion")
    reader.add_problem(kMarkKey, "must be \"euler_angles\" or \"quaternion\"");
  if (pose.parameterization == "euler_angles" && !is_convention(pose.convention))
    reader.add_problem("convention", "must be three of X, Y and Z, neighbours different");
  if (pose.orientation != "AP" && pose.orientation != "PA" && pose.orientation != "none")
    reader.add_problem("orientation", "must be \"AP\", \"PA\" or \"none\"");
}

}  // namespace

RigidTransform world_from_diffdrr_camera(const DiffDrrPose& pose) {
  const Matrix3d rotation = rotation_of(pose);
  RigidTransform world_from_camera = RigidTransform::Identity();
  world_from_camera.linear() = rotation * orientation_rotation(pose.orientation);
  world_from_camera.translation() = rotation * pose.translation_mm;
  return world_from_camera;
}

RigidTransform room_from_diffdrr_camera(const CameraGeometry& camera) {
  if (camera.is_mirrored())
    throw InputError("camera", camera.name, "must not be mirrored: DiffDRR's cameras are not");
  RigidTransform room_from_camera = RigidTransform::Identity();
  room_from_camera.linear().col(0) = -camera.column_direction;
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

bool is_diffdrr(const PoseFileBytes& file) {
  return file.bytes.find(kMarkKey) != std::string::npos;
}

PosesInFile read_diffdrr(const PoseFileBytes& file, const PoseContext& context) {
  const std::string name = file.path.string();
  const toml::table table = parse_toml(file.bytes, name);
  TomlProblems problems(name);
  TomlTableReader reader(table, "", problems);
  DiffDrrPose pose;
  pose.parameterization = reader.get_string(kMarkKey, Presence::Required).value_or("");
  pose.convention = reader.get_string("convention", Presence::Optional).value_or(pose.convention);
  pose.orientation =
      reader.get_string("orientation", Presence::Optional).value_or(pose.orientation);
  check_pose(reader, pose);
  const int numbers = pose.parameterization == "quaternion" ? 4 : 3;
  const char* const rotation_key = numbers == 4 ? "rotation" : "rotation_rad";
  const auto rotations = reader.get_matrix(rotation_key, -1, numbers, Presence::Required);
  const auto translations = reader.get_matrix("translation_mm", -1, 3, Presence::Required);
  const auto middle = reader.get_vector<3>("volume_middle_ct_mm", Presence::Optional);
  const std::string camera = reader.get_string("camera", Presence::Optional).value_or("");
  if (rotations && translations && rotations->rows() != translations->rows())
    reader.add_problem("translation_mm", "must have as many rows as the rotations");
  reader.refuse_unknown_keys();
  problems.throw_if_any();
  const RigidTransform room_from_camera =
      room_from_diffdrr_camera(camera_of(rig_of(context, name), camera, name));
  const RigidTransform from_ct = world_from_ct(middle ? *middle : middle_of(context, name));
  PosesInFile found;
  for (Eigen::Index i = 0; i < rotations->rows(); ++i) {
    const Eigen::VectorXd rotation = rotations->row(i).transpose();
    const std::string where = name + ": pose " + std::to_string(i + 1);
    if (numbers == 4 && !(std::abs(rotation.norm() - 1.0) <= 1e-5))
      throw InputError(where + ": the quaternion's norm is not 1");
    pose.rotation.assign(rotation.begin(), rotation.end());
    pose.translation_mm = translations->row(i).transpose();
    const RigidTransform room_from_ct =
        room_from_camera * world_from_diffdrr_camera(pose).inverse() * from_ct;
    found.poses.push_back({i + 1, rigid_or_throw(room_from_ct.matrix(), where)});
  }
  return found;
}

std::string write_diffdrr(std::span<const RigidTransform> room_from_ct,
                          const PoseContext& context) {
  const CameraGeometry camera = camera_of(rig_of(context, "diffdrr"), "", "diffdrr");
  const Vector3d middle = middle_of(context, "diffdrr");
  const DiffDrrPose frame;
  std::string rotations;
  std::string translations;
  for (const RigidTransform& pose : room_from_ct) {
    const RigidTransform world_from_camera =
        world_from_ct(middle) * pose.inverse() * room_from_diffdrr_camera(camera);
    const Matrix3d rotation =
        world_from_camera.linear() * orientation_rotation(frame.orientation).transpose();
    rotations += (rotations.empty() ? "" : ", ") +
                 toml_numbers(angles_of_convention(rotation, frame.convention));
    translations += (translations.empty() ? "" : ", ") +
                    toml_numbers(rotation.transpose() * world_from_camera.translation());
  }
  return "# drr(rotation_rad, translation_mm, parameterization=\"euler_angles\", "
         "convention=\"ZXY\"),\n"
         "# of a Subject read with orientation=\"AP\" and center_volume=True; DiffDRR 0.4 or "
         "later.\n" +
         std::string(kMarkKey) + " = \"euler_angles\"\nconvention = \"" + frame.convention +
         "\"\norientation = \"" + frame.orientation + "\"\ncamera = " + toml_text(camera.name) +
         "\nvolume_middle_ct_mm = " + toml_numbers(middle) + "\nrotation_rad = [" + rotations +
         "]\ntranslation_mm = [" + translations + "]\n";
}

}  // namespace af
