// SPDX-License-Identifier: Apache-2.0
#include "pose_files/diffdrr_pose.h"

#include "base/error.h"
#include "base/toml_text.h"
#include "geometry/diffdrr_convention.h"
#include "text/toml_reader.h"

namespace af {
namespace {

using Eigen::Vector3d;

constexpr const char* kMarkKey = "diffdrr_parameterization";

CameraRig rig_of(const PoseContext& context, const std::string& file) {
  if (!context.rig)
    throw InputError(file +
                     ": a DiffDRR pose is relative to a camera; give its rig (--rig, or --study)");
  return context.rig();
}

Vector3d middle_of(const PoseContext& context, const std::string& file) {
  if (!context.ct_grid)
    throw InputError(file +
                     ": a DiffDRR pose is about the middle of the CT; state volume_middle_ct_mm, "
                     "or give the CT (--ct, or --study)");
  return context.ct_grid().center_mm();
}

/// The only one, where none is named.
CameraGeometry camera_of(const CameraRig& rig, const std::string& name, const std::string& file) {
  if (!name.empty()) return rig.camera(name);
  if (rig.cameras.size() != 1)
    throw InputError(file + ": names no camera, and the rig has several; choose one with --camera");
  return rig.cameras.front();
}

/// DiffDRR's cameras are not mirrored, unless reverse_x_axis=False, which no pose states.
RigidTransform room_from_camera_of(const CameraGeometry& camera) {
  if (camera.is_mirrored())
    throw InputError("camera", camera.name, "must not be mirrored: DiffDRR's cameras are not");
  return room_from_diffdrr_camera(camera);
}

}  // namespace

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
  for (const DiffDrrProblem& problem : af::problems(pose))
    reader.add_problem(problem.member == "parameterization" ? kMarkKey : problem.member.c_str(),
                       problem.constraint);
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
      room_from_camera_of(camera_of(rig_of(context, name), camera, name));
  const RigidTransform world_from_ct =
      diffdrr_world_from_lps(middle ? *middle : middle_of(context, name));
  PosesInFile found;
  for (Eigen::Index i = 0; i < rotations->rows(); ++i) {
    const Eigen::VectorXd rotation = rotations->row(i).transpose();
    const std::string where = name + ": pose " + std::to_string(i + 1);
    pose.rotation.assign(rotation.begin(), rotation.end());
    for (const DiffDrrProblem& problem : af::problems(pose))
      throw InputError(where + ": " + problem.member + " " + problem.constraint);
    pose.translation_mm = translations->row(i).transpose();
    const RigidTransform room_from_ct =
        room_from_camera * world_from_diffdrr_camera(pose).inverse() * world_from_ct;
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
        diffdrr_world_from_lps(middle) * pose.inverse() * room_from_camera_of(camera);
    const DiffDrrPose written = diffdrr_pose_of(world_from_camera);
    rotations += (rotations.empty() ? "" : ", ") +
                 toml_numbers(Eigen::Map<const Vector3d>(written.rotation.data()));
    translations += (translations.empty() ? "" : ", ") + toml_numbers(written.translation_mm);
  }
  return "# drr(rotation_rad, translation_mm, parameterization=\"euler_angles\", "
         "convention=\"ZXY\"),\n"
         "# of a Subject read with orientation=\"AP\" and center_volume=True; older releases "
         "of DiffDRR than 0.4.0 mean another pose.\n" +
         std::string(kMarkKey) + " = \"euler_angles\"\nconvention = \"" + frame.convention +
         "\"\norientation = \"" + frame.orientation + "\"\ncamera = " + toml_text(camera.name) +
         "\nvolume_middle_ct_mm = " + toml_numbers(middle) + "\nrotation_rad = [" + rotations +
         "]\ntranslation_mm = [" + translations + "]\n";
}

}  // namespace af
