// SPDX-License-Identifier: Apache-2.0
#include "study/rig_toml.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include <Eigen/Geometry>

#include "base/error.h"
#include "base/file_name.h"
#include "base/joined.h"
#include "base/toml_text.h"
#include "files/toml_reader.h"

namespace af {

namespace {

constexpr const char* kCArmText =
    R"(# A 12-inch C-arm in two positions (the paper's): half field of view 8.5 degrees, source to isocentre 650 mm,
# source to detector 1020 mm.
isocenter_point = [0.0, 0.0, 0.0]                # room, mm

[[camera]]
name = "AP"
source_point = [0.0, -650.0, 0.0]                # in front of a supine patient
detector_origin_point = [-151.8046875, 370.0, 151.8046875]  # centre of pixel (0, 0)
column_direction = [1.0, 0.0, 0.0]               # unit, of increasing column
row_direction = [0.0, 0.0, -1.0]                 # unit, of increasing row
pixel_spacing_mm = [1.190625, 1.190625]          # column, row
size_px = [256, 256]                             # columns, rows

[[camera]]
name = "LAT"
source_point = [650.0, 0.0, 0.0]
detector_origin_point = [-370.0, -151.8046875, 151.8046875]
column_direction = [0.0, 1.0, 0.0]
row_direction = [0.0, 0.0, -1.0]
pixel_spacing_mm = [1.190625, 1.190625]
size_px = [256, 256]
)";

/// Its numbers are 2600 and 1000 mm times +-sqrt(1/2). From there, half the span of the outermost
/// pixel centres, 102.2 mm, is subtracted along each of the detector's axes.
constexpr const char* kTreatmentRoomText =
    R"(# A radiotherapy treatment room: two fixed cameras above the patient, at +-45 degrees in the axial plane and so
# orthogonal; source to isocentre 2600 mm, source to detector 3600 mm.
isocenter_point = [0.0, 0.0, 0.0]                # room, mm

[[camera]]                                       # beam along (1, 1, 0) / sqrt(2)
name = "A"
source_point = [-1838.4776310850236, -1838.4776310850236, 0.0]
detector_origin_point = [634.8404681492824, 779.3730942238127, 102.2]  # centre of pixel (0, 0)
column_direction = [0.7071067811865476, -0.7071067811865476, 0.0]  # unit, of increasing column
row_direction = [0.0, 0.0, -1.0]                 # unit, of increasing row
pixel_spacing_mm = [0.4, 0.4]                    # column, row
size_px = [512, 512]                             # columns, rows

[[camera]]                                       # beam along (-1, 1, 0) / sqrt(2)
name = "B"
source_point = [1838.4776310850236, -1838.4776310850236, 0.0]
detector_origin_point = [-779.3730942238127, 634.8404681492824, 102.2]
column_direction = [0.7071067811865476, 0.7071067811865476, 0.0]
row_direction = [0.0, 0.0, -1.0]
pixel_spacing_mm = [0.4, 0.4]
size_px = [512, 512]
)";

const std::map<std::string, const char*>& builtin_rigs() {
  static const std::map<std::string, const char*> rigs = {{"c-arm-12in", kCArmText},
                                                          {"treatment-room", kTreatmentRoomText}};
  return rigs;
}

constexpr std::array kGeometryKeys = {
    "source_point", "detector_origin_point", "column_direction", "row_direction"};

/// The camera's constraints that geometry knows, each reported at the line of its key.
bool note_geometry_problems(const CameraGeometry& camera,
                            const toml::table& table,
                            TomlProblems& problems) {
  const auto found = af::problems(camera);
  for (const std::string& message : found) {
    const toml::node* place = &table;
    for (const auto& [key, value] : table)
      if (message.find(": " + std::string(key.str()) + " = ") != std::string::npos) place = &value;
    problems.add(*place, message);
  }
  return found.empty();
}

/// Pixels times mm, at any scale whose third power is finite.
constexpr double kMaxProjection = 1e90;

std::optional<CameraGeometry> camera_from_matrix(TomlTableReader& reader,
                                                 const CameraGeometry& stated,
                                                 const Eigen::Vector3d& isocenter_point,
                                                 TomlProblems& problems) {
  for (const char* key : kGeometryKeys)
    if (reader.has(key))
      reader.add_problem(
          key, "must not be given together with projection_matrix, which already fixes it");
  const auto matrix =
      reader.get_matrix("projection_matrix", 3, 4, Presence::Required, kMaxProjection);
  if (!matrix || !(stated.pixel_spacing_mm.minCoeff() > 0.0)) return std::nullopt;
  try {
    return CameraGeometry::from_projection_matrix(
        stated.name, *matrix, stated.pixel_spacing_mm, stated.size_px, isocenter_point);
  } catch (const InputError& error) {
    problems.add(reader.node("projection_matrix"), error.what());
    return std::nullopt;
  }
}

std::optional<CameraGeometry> camera_from_keys(TomlTableReader& reader,
                                               const CameraGeometry& stated,
                                               const Eigen::Vector3d& /*isocenter_point*/,
                                               TomlProblems& /*problems*/) {
  const auto source = reader.get_vector<3>("source_point", Presence::Required);
  const auto origin = reader.get_vector<3>("detector_origin_point", Presence::Required);
  const auto column = reader.get_vector<3>("column_direction", Presence::Required);
  const auto row = reader.get_vector<3>("row_direction", Presence::Required);
  if (!source || !origin || !column || !row) return std::nullopt;
  CameraGeometry camera = stated;
  camera.source_point = *source;
  camera.detector_origin_point = *origin;
  camera.column_direction = *column;
  camera.row_direction = *row;
  return camera;
}

/// distortion = [k1, k2, p1, p2], or five or eight numbers, in OpenCV's order.
LensDistortion read_distortion(TomlTableReader& reader) {
  constexpr const char* kKey = "distortion";
  LensDistortion distortion;
  if (!reader.has(kKey)) return distortion;
  const toml::array* const numbers = reader.node(kKey).as_array();
  const std::size_t count = numbers == nullptr ? 0 : numbers->size();
  if (count != 4 && count != 5 && count != 8) {
    reader.add_problem(kKey,
                       "must be OpenCV's k1, k2, p1, p2, or these with k3, or with k3, k4, k5, k6");
    return distortion;
  }
  for (std::size_t i = 0; i < count; ++i) {
    const auto number = (*numbers)[i].value<double>();
    if (!number || !std::isfinite(*number)) {
      reader.add_problem(kKey, "must be finite numbers");
      return {};
    }
    distortion.coefficients[i] = *number;
  }
  return distortion;
}

using CameraMaker = std::optional<CameraGeometry> (*)(TomlTableReader& reader,
                                                      const CameraGeometry& stated,
                                                      const Eigen::Vector3d& isocenter_point,
                                                      TomlProblems& problems);

/// A way of stating a camera, recognised by a key that only it has.
struct CameraForm {
  const char* key;
  CameraMaker make;
};

/// Every form. A new one is added here. The first is for tables without such a key, and the one in
/// which rigs are written.
constexpr std::array kCameraForms = {
    CameraForm{"source_point", camera_from_keys},
    CameraForm{"projection_matrix", camera_from_matrix},
};

const CameraForm& form_of(TomlTableReader& reader) {
  // The last form comes first, because keys of the first beside another form are an error of that
  // form.
  for (auto form = kCameraForms.rbegin(); form != kCameraForms.rend(); ++form)
    if (reader.has(form->key)) return *form;
  return kCameraForms.front();
}

std::optional<CameraGeometry> read_camera(const toml::table& table,
                                          std::size_t index,
                                          const Eigen::Vector3d& isocenter_point,
                                          TomlProblems& problems) {
  TomlTableReader reader(table, "camera[" + std::to_string(index) + "].", problems);
  const auto name = reader.get_string("name", Presence::Required);
  const auto spacing = reader.get_vector<2>("pixel_spacing_mm", Presence::Required);
  const auto size = reader.get_integers("size_px", 2, Presence::Required);
  if (name)
    if (const std::string problem = camera_name_problem(*name); !problem.empty())
      reader.add_problem("name", problem);
  CameraGeometry stated;
  stated.name = name.value_or("");
  stated.distortion = read_distortion(reader);
  stated.pixel_spacing_mm = spacing.value_or(Eigen::Vector2d::Ones());
  stated.size_px = size ? Eigen::Vector2i((*size)[0], (*size)[1]) : Eigen::Vector2i(1, 1);
  auto camera = form_of(reader).make(reader, stated, isocenter_point, problems);
  reader.refuse_unknown_keys();
  if (!camera || !name) return std::nullopt;
  camera->distortion = stated.distortion;
  // Ones stand in for missing sizes, so that the rest is checked too.
  if (!note_geometry_problems(*camera, table, problems) || !spacing || !size) return std::nullopt;
  clean_axes(*camera);
  return camera;
}

void warn_if_mirrored(const CameraGeometry& camera,
                      const std::string& where,
                      std::vector<std::string>* warnings) {
  if (warnings == nullptr || !camera.is_mirrored()) return;
  warnings->push_back(where + ": camera '" + camera.name +
                      "': mirrored: column_direction x row_direction points against the beam, so "
                      "its images show left and right swapped");
}

CameraRig rig_from_table(const toml::table& table,
                         const std::string& file,
                         std::vector<std::string>* warnings) {
  TomlProblems problems(file);
  TomlTableReader reader(table, "", problems);
  CameraRig rig;
  rig.isocenter_point =
      reader.get_vector<3>("isocenter_point", Presence::Required).value_or(Eigen::Vector3d::Zero());
  std::map<std::string, std::string> place_of_name;
  std::size_t index = 0;
  for (const toml::table* camera_table : reader.get_tables("camera", Presence::Required)) {
    const auto camera = read_camera(*camera_table, index++, rig.isocenter_point, problems);
    if (!camera) continue;
    const auto [earlier, is_new] =
        place_of_name.emplace(camera->name, problems.where(*camera_table));
    if (!is_new)
      problems.add(*camera_table,
                   "camera name = \"" + camera->name + "\": must be unique, but stands at " +
                       earlier->second + " too");
    warn_if_mirrored(*camera, problems.where(*camera_table), warnings);
    rig.cameras.push_back(*camera);
  }
  reader.refuse_unknown_keys();
  problems.throw_if_any();
  throw_if_any(af::problems(rig), file);
  return rig;
}

}  // namespace

void clean_axes(CameraGeometry& camera) {
  constexpr double kExact = 1e-12;
  const auto make_unit = [](Eigen::Vector3d& direction) {
    if (std::abs(direction.norm() - 1.0) > kExact) direction.normalize();
  };
  make_unit(camera.column_direction);
  const double cosine = camera.column_direction.dot(camera.row_direction);
  if (std::abs(cosine) > kExact) camera.row_direction -= cosine * camera.column_direction;
  make_unit(camera.row_direction);
}

std::vector<std::string> builtin_rig_names() {
  std::vector<std::string> names;
  for (const auto& [name, text] : builtin_rigs()) names.push_back(name);
  return names;
}

std::string builtin_rig_text(const std::string& name) {
  const auto found = builtin_rigs().find(name);
  if (found == builtin_rigs().end())
    throw InputError("rig", name, "the shipped rigs are " + joined(builtin_rig_names()));
  return found->second;
}

std::string camera_name_problem(const std::string& name) {
  if (!is_utf8(name)) return "must be UTF-8: a rig.toml could not state it";
  if (is_plain_file_name(name) && name.find('=') == std::string::npos) return "";
  return std::string("must be usable in a file name") + kPlainFileName + "; no '='";
}

CameraRig parse_rig(const std::string& text,
                    const std::string& file,
                    std::vector<std::string>* warnings) {
  return rig_from_table(parse_toml(text, file), file, warnings);
}

std::string rig_to_toml(const CameraRig& rig) {
  std::string text = "isocenter_point = " + toml_numbers(rig.isocenter_point) + "\n";
  for (const CameraGeometry& camera : rig.cameras) {
    text += "\n[[camera]]\nname = " + toml_text(camera.name) + "\n";
    text += "source_point = " + toml_numbers(camera.source_point) + "\n";
    text += "detector_origin_point = " + toml_numbers(camera.detector_origin_point) + "\n";
    text += "column_direction = " + toml_numbers(camera.column_direction) + "\n";
    text += "row_direction = " + toml_numbers(camera.row_direction) + "\n";
    text += "pixel_spacing_mm = " + toml_numbers(camera.pixel_spacing_mm) + "\n";
    text += "size_px = [" + std::to_string(camera.size_px.x()) + ", " +
            std::to_string(camera.size_px.y()) + "]\n";
    if (!camera.distortion.is_none())
      text += "distortion = " +
              toml_numbers(Eigen::Map<const Eigen::VectorXd>(
                  camera.distortion.coefficients.data(),
                  static_cast<Eigen::Index>(camera.distortion.count()))) +
              "\n";
  }
  return text;
}

}  // namespace af
