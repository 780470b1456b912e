// SPDX-License-Identifier: Apache-2.0
#include "study/study_file.h"

#include <algorithm>
#include <cmath>
#include <map>

#include <Eigen/Dense>

#include "base/error.h"
#include "base/file_name.h"
#include "base/named_rows.h"
#include "base/toml_text.h"
#include "files/toml_reader.h"
#include "geometry/fiducial_registration.h"
#include "geometry/target_box.h"
#include "study/ct_keys.h"
#include "study/landmark_start.h"
#include "study/rig_file.h"
#include "study/target_place.h"

namespace af {

namespace {

namespace fs = std::filesystem;

/// What every part of a study needs to know when it is read.
struct StudyContext {
  fs::path folder;  ///< absolute; paths of the study are relative to it
  const CameraRig& rig;
  TomlProblems& problems;
};

/// Removes "." and doubled slashes. A ".." stays, because removing it as text would be wrong behind
/// a symbolic link.
fs::path tidied(const fs::path& path) {
  const bool goes_up = std::find(path.begin(), path.end(), "..") != path.end();
  return goes_up ? path : path.lexically_normal();
}

fs::path resolved(const fs::path& folder, const std::string& path) {
  return tidied(folder / path);
}

/// Notes the path's place in `places`.
std::optional<fs::path> get_path(TomlTableReader& reader,
                                 const char* key,
                                 Presence presence,
                                 const fs::path& folder,
                                 StudyPlaces& places) {
  const auto text = reader.get_string(key, presence);
  if (!text) return std::nullopt;
  places[key] = reader.place(key);
  return resolved(folder, *text);
}

template <int Size>
std::vector<Eigen::Matrix<double, Size, 1>> get_points(TomlTableReader& reader,
                                                       const char* key,
                                                       RowGaps gaps = RowGaps::Refused) {
  std::vector<Eigen::Matrix<double, Size, 1>> points;
  if (const auto matrix = reader.get_matrix(key, -1, Size, Presence::Optional, kMaxRoomMm, gaps))
    for (Eigen::Index i = 0; i < matrix->rows(); ++i)
      points.emplace_back(matrix->row(i).transpose());
  return points;
}

/// True when the points lie on one line (or are fewer than three), which would leave a rotation
/// about that line free.
bool are_collinear(const std::vector<Eigen::Vector3d>& points) {
  if (points.size() < 3) return true;
  Eigen::Matrix3Xd centered(3, static_cast<Eigen::Index>(points.size()));
  for (std::size_t i = 0; i < points.size(); ++i)
    centered.col(static_cast<Eigen::Index>(i)) = points[i];
  centered.colwise() -= Eigen::Vector3d(centered.rowwise().mean());
  const Eigen::Vector3d singular_values =
      Eigen::JacobiSVD<Eigen::Matrix3d, Eigen::NoQRPreconditioner>(centered * centered.transpose())
          .singularValues();
  // The second largest extent relative to the largest, as variances.
  constexpr double kLeastWidth = 1e-3;
  return !(singular_values[1] > kLeastWidth * kLeastWidth * singular_values[0]);
}

CtBox get_target_box(TomlTableReader& reader, StudyPlaces& places) {
  CtBox box{Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero()};
  const auto corners = reader.get_matrix("target_box_ct_mm", 2, 3, Presence::Required);
  if (!corners) return box;
  places["target_box_ct_mm"] = reader.place("target_box_ct_mm");
  box = {corners->row(0).transpose(), corners->row(1).transpose()};
  if (const std::string problem = target_box_problem(box); !problem.empty())
    reader.add_problem("target_box_ct_mm", problem);
  return box;
}

XrayDomain get_xray_domain(TomlTableReader& reader) {
  const auto text = reader.get_string("xray_domain", Presence::Required);
  if (text && *text != "intensity" && *text != "attenuation")
    reader.add_problem("xray_domain", "must be \"intensity\" or \"attenuation\"");
  return text == "attenuation" ? XrayDomain::Attenuation : XrayDomain::Intensity;
}

RegionOfInterest get_roi(TomlTableReader& reader, const CameraGeometry* camera) {
  RegionOfInterest roi;
  if (camera != nullptr) roi = {0, 0, camera->size_px.x(), camera->size_px.y()};
  const auto numbers = reader.get_integers("roi_px", 4, Presence::Optional);
  if (!numbers) return roi;
  roi = {(*numbers)[0], (*numbers)[1], (*numbers)[2], (*numbers)[3]};
  if (camera != nullptr && !problems(roi, camera->size_px.x(), camera->size_px.y()).empty())
    reader.add_problem("roi_px",
                       "must be [column, row, width, height] and lie on the detector of camera '" +
                           camera->name + "', " + std::to_string(camera->size_px.x()) + " x " +
                           std::to_string(camera->size_px.y()) + " pixels");
  return roi;
}

const CameraGeometry* get_camera(TomlTableReader& reader, const CameraRig& rig) {
  const auto name = reader.get_string("camera", Presence::Required);
  if (!name) return nullptr;
  const CameraGeometry* const camera = find_row(rig.cameras, *name);
  if (camera == nullptr)
    reader.add_problem("camera",
                       "must be a camera of the rig, which has " + joined(names_of(rig.cameras)));
  return camera;
}

void check_fiducials(TomlTableReader& reader,
                     const StudyView& view,
                     std::size_t expected,
                     const CameraGeometry* camera) {
  if (view.fiducials_px.size() != expected)
    reader.add_problem("fiducials_px",
                       "has " + std::to_string(view.fiducials_px.size()) +
                           " points, but the case has " + std::to_string(expected) +
                           " fiducials_ct_mm; they must be as many, in the same order");
  if (camera == nullptr) return;
  const Eigen::Array2d edge = camera->size_px.cast<double>().array() - 0.5;
  for (const Eigen::Vector2d& point : view.fiducials_px)
    if (is_seen(point) && !((point.array() >= -0.5).all() && (point.array() <= edge).all())) {
      reader.add_problem("fiducials_px",
                         "point " + toml_numbers(point) + " must lie on the detector of camera '" +
                             camera->name + "'");
      return;
    }
}

/// mask = "auto", a file, or both in a list. A file with that name is "./auto".
void read_mask_key(TomlTableReader& reader, const fs::path& folder, StudyView& view) {
  constexpr const char* kKey = "mask";
  if (!reader.has(kKey)) return;
  const toml::node& node = reader.node(kKey);
  toml::array one;
  if (!node.is_array()) one.push_back(node);
  const toml::array& entries = node.is_array() ? *node.as_array() : one;
  for (const toml::node& entry : entries) {
    const auto text = entry.value<std::string>();
    const bool is_auto = text == "auto";
    const bool is_again = is_auto ? view.reading.masks_borders : view.mask.has_value();
    if (!text || text->empty() || is_again)
      return reader.add_problem(kKey, "must be \"auto\", a file, or [\"auto\", a file]");
    if (is_auto)
      view.reading.masks_borders = true;
    else
      view.mask = resolved(folder, *text);
  }
  if (view.mask) view.places[kKey] = reader.place(kKey);
}

/// The reverse of read_mask_key().
std::string mask_text(const StudyView& view,
                      const std::function<std::string(const fs::path&)>& path_text) {
  const std::string file = view.mask ? toml_text(path_text(*view.mask)) : std::string();
  if (!view.reading.masks_borders) return file.empty() ? "" : "mask = " + file + "\n";
  return file.empty() ? "mask = \"auto\"\n" : "mask = [\"auto\", " + file + "]\n";
}

/// One entry of landmarks_px: a point, or [] or [nan, nan] for one that is not visible. False when
/// it is neither.
bool get_landmark(const toml::node& node, std::optional<Eigen::Vector2d>& point) {
  const toml::array* const numbers = node.as_array();
  if (numbers == nullptr || (!numbers->empty() && numbers->size() != 2)) return false;
  if (numbers->empty()) return true;
  const auto column = (*numbers)[0].value<double>();
  const auto row = (*numbers)[1].value<double>();
  if (!column || !row) return false;
  if (std::isnan(*column) && std::isnan(*row)) return true;
  point = Eigen::Vector2d(*column, *row);
  return point->allFinite();
}

std::vector<std::optional<Eigen::Vector2d>> get_landmarks(TomlTableReader& reader,
                                                          std::size_t expected,
                                                          const CameraGeometry* camera) {
  constexpr const char* kKey = "landmarks_px";
  constexpr const char* kMust = "must be a list of [column, row], or [] where one is not visible";
  std::vector<std::optional<Eigen::Vector2d>> points;
  if (!reader.has(kKey)) return points;
  const toml::array* const entries = reader.node(kKey).as_array();
  if (entries == nullptr) {
    reader.add_problem(kKey, kMust);
    return points;
  }
  if (const std::size_t count = entries->size(); count != expected) {
    reader.add_problem(kKey,
                       "has " + std::to_string(count) + " entries, but the case has " +
                           std::to_string(expected) +
                           " landmarks_ct_mm; they must be as many, in the same order, [] where "
                           "one is not visible");
    return points;
  }
  for (const toml::node& entry : *entries) {
    std::optional<Eigen::Vector2d> point;
    if (!get_landmark(entry, point)) {
      reader.add_problem(kKey, kMust);
      return {};
    }
    const bool is_off = point && camera != nullptr &&
                        !((point->array() >= -0.5).all() &&
                          (point->array() <= camera->size_px.cast<double>().array() - 0.5).all());
    if (is_off)
      reader.add_problem(kKey,
                         "point " + toml_numbers(*point) + " must lie on the detector of camera '" +
                             camera->name + "'");
    points.push_back(point);
  }
  return points;
}

/// Points are stated in the stored X-ray. From here on they refer to the undistorted one.
void undistort_points(TomlTableReader& reader, const CameraGeometry& camera, StudyView& view) {
  if (camera.distortion.is_none()) return;
  const PixelDistortion distortion(camera);
  const auto undistort = [&](const char* key, Eigen::Vector2d& point) {
    if (const auto ideal = distortion.ideal_from_stored(point); ideal.has_value())
      point = *ideal;
    else
      reader.add_problem(key,
                         "point " + toml_numbers(point) + " is where the lens of camera '" +
                             camera.name + "' shows nothing");
  };
  for (Eigen::Vector2d& point : view.fiducials_px)
    if (is_seen(point)) undistort("fiducials_px", point);
  for (std::optional<Eigen::Vector2d>& point : view.landmarks_px)
    if (point) undistort("landmarks_px", *point);
}

StudyView read_view(const toml::table& table,
                    const std::string& prefix,
                    const StudyCase& study_case,
                    const StudyContext& context) {
  TomlTableReader reader(table, prefix, context.problems);
  StudyView view;
  const CameraGeometry* camera = get_camera(reader, context.rig);
  if (camera != nullptr) view.camera = camera->name;
  const auto path = [&](const char* key, Presence presence) {
    return get_path(reader, key, presence, context.folder, view.places);
  };
  view.xray = path("xray", Presence::Required).value_or(fs::path());
  view.xray_domain = get_xray_domain(reader);
  view.roi = get_roi(reader, camera);
  view.is_roi_stated = reader.has("roi_px");
  view.fiducials_px = get_points<2>(reader, "fiducials_px", RowGaps::Allowed);
  view.field = path("field", Presence::Optional);
  view.reading = read_xray_keys(
      reader, view.xray_domain, [&](const char* key) { return path(key, Presence::Optional); });
  read_mask_key(reader, context.folder, view);
  check_fiducials(reader, view, study_case.fiducials_ct_mm.size(), camera);
  view.landmarks_px = get_landmarks(reader, study_case.landmarks_ct_mm.size(), camera);
  if (camera != nullptr) undistort_points(reader, *camera, view);
  reader.refuse_unknown_keys();
  return view;
}

/// Case names become parts of file names.
void check_case_name(TomlTableReader& reader, const std::string& name) {
  if (!name.empty() && !is_plain_file_name(name))
    reader.add_problem("name", std::string("must be usable in a file name") + kPlainFileName);
}

void read_views(TomlTableReader& reader,
                const std::string& prefix,
                StudyCase& study_case,
                const StudyContext& context) {
  std::map<std::string, std::string> place_of_camera;
  for (const toml::table* view_table : reader.get_tables("view", Presence::Required)) {
    const std::string view_prefix =
        prefix + "view[" + std::to_string(study_case.views.size()) + "].";
    study_case.views.push_back(read_view(*view_table, view_prefix, study_case, context));
    const std::string& camera = study_case.views.back().camera;
    const auto [earlier, is_new] =
        place_of_camera.emplace(camera, context.problems.where(*view_table));
    if (!is_new && !camera.empty())
      context.problems.add(*view_table,
                           std::string(view_prefix)
                               .append("camera = '")
                               .append(camera)
                               .append("': already has a view in this case, at ")
                               .append(earlier->second));
  }
}

/// Without a stated pose, the target's centre lies at the isocentre and the patient's axes along
/// the room's.
RigidTransform pose_at_isocenter(const CameraRig& rig, const StudyCase& study_case) {
  return PoseFrame{Eigen::Matrix3d::Identity(), study_case.center_ct_mm, rig.isocenter_point}
      .nominal_room_from_ct();
}

/// The nominal pose must show the target box to every camera of the case.
void check_beams(TomlTableReader& reader,
                 const StudyContext& context,
                 const StudyCase& study_case) {
  if (!context.problems.empty()) return;
  for (const StudyView& view : study_case.views) {
    const std::string problem = beam_problem(study_case, context.rig.camera(view.camera));
    if (problem.empty()) continue;
    if (reader.has("nominal_room_from_ct"))
      reader.add_problem("nominal_room_from_ct",
                         problem + "; without this key center_ct_mm is put at the isocentre");
    else if (study_case.landmarks_ct_mm.empty())
      reader.add_problem("target_box_ct_mm",
                         problem + "; center_ct_mm is what lies at the isocentre there");
    else
      reader.add_problem("target_box_ct_mm", problem);
    return;
  }
}

/// A case that states landmarks and no nominal pose takes the landmarks' pose as its nominal one.
void take_nominal_from_landmarks(TomlTableReader& reader,
                                 const StudyContext& context,
                                 StudyCase& study_case) {
  if (!context.problems.empty()) return;
  try {
    study_case.nominal_room_from_ct = landmark_pose(context.rig, study_case).room_from_ct;
  } catch (const InputError& error) {
    reader.add_problem(
        "landmarks_ct_mm",
        std::string("must give the nominal pose, which is not stated: ") + error.what());
  }
}

StudyCase read_case(const toml::table& table,
                    const std::string& prefix,
                    const StudyContext& context) {
  TomlTableReader reader(table, prefix, context.problems);
  StudyCase study_case;
  study_case.name = reader.get_string("name", Presence::Required).value_or("");
  check_case_name(reader, study_case.name);
  study_case.note = reader.get_string("note", Presence::Optional).value_or("");
  study_case.ct =
      get_path(reader, "ct", Presence::Required, context.folder, study_case.places).value_or("");
  study_case.ct_reading = read_ct_keys(reader);
  study_case.landmarks_ct_mm = get_points<3>(reader, "landmarks_ct_mm");
  study_case.center_ct_mm =
      reader.get_vector<3>("center_ct_mm", Presence::Required).value_or(Eigen::Vector3d::Zero());
  study_case.nominal_room_from_ct = reader.get_pose("nominal_room_from_ct", Presence::Optional)
                                        .value_or(pose_at_isocenter(context.rig, study_case));
  study_case.is_nominal_stated =
      reader.has("nominal_room_from_ct") || !study_case.landmarks_ct_mm.empty();
  study_case.target_box_ct = get_target_box(reader, study_case.places);
  study_case.fiducials_ct_mm = get_points<3>(reader, "fiducials_ct_mm");
  if (!study_case.fiducials_ct_mm.empty() && are_collinear(study_case.fiducials_ct_mm))
    reader.add_problem("fiducials_ct_mm", "must be at least 3 points that are not collinear");
  study_case.gold_room_from_ct = reader.get_pose("gold_room_from_ct", Presence::Optional);
  read_views(reader, prefix, study_case, context);
  if (!reader.has("nominal_room_from_ct") && !study_case.landmarks_ct_mm.empty())
    take_nominal_from_landmarks(reader, context, study_case);
  check_beams(reader, context, study_case);
  reader.refuse_unknown_keys();
  return study_case;
}

void read_cases(TomlTableReader& reader, Study& study, const StudyContext& context) {
  std::map<std::string, std::string> place_of_name;
  for (const toml::table* table : reader.get_tables("case", Presence::Required)) {
    const std::string prefix = "case[" + std::to_string(study.cases.size()) + "].";
    study.cases.push_back(read_case(*table, prefix, context));
    const std::string& name = study.cases.back().name;
    const auto [earlier, is_new] = place_of_name.emplace(name, context.problems.where(*table));
    if (!is_new && !name.empty())
      context.problems.add(*table,
                           std::string(prefix)
                               .append("name = '")
                               .append(name)
                               .append("': is already the name of the case at ")
                               .append(earlier->second));
  }
}

/// The rig's shipped name, or the absolute paths of its files.
std::string resolved_rig(const std::string& rig, const fs::path& folder) {
  // A comma in the name of one file does not make it two.
  if (fs::exists(resolved(folder, rig))) return resolved(folder, rig).string();
  const std::vector<fs::path> files = rig_files(rig);
  if (files.empty()) return rig;
  return joined(
      files, ",", [&](const fs::path& file) { return resolved(folder, file.string()).string(); });
}

std::string relative_if_below(const fs::path& path, const fs::path& folder) {
  const fs::path relative = path.lexically_relative(folder);
  const bool is_below = !relative.empty() && relative != "." && *relative.begin() != "..";
  return (is_below ? relative : path).generic_string();
}

template <int Size>
std::string points_text(const std::vector<Eigen::Matrix<double, Size, 1>>& points) {
  std::string text = "[";
  for (std::size_t i = 0; i < points.size(); ++i)
    text +=
        (i > 0 ? ", " : "") + (points[i].allFinite() ? toml_numbers(points[i]) : std::string("[]"));
  return text + "]";
}

/// The reverse of undistort_points().
StudyView with_stored_points(StudyView view, const CameraRig& rig) {
  const CameraGeometry* const camera = find_row(rig.cameras, view.camera);
  if (camera == nullptr || camera->distortion.is_none()) return view;
  const PixelDistortion distortion(*camera);
  for (Eigen::Vector2d& point : view.fiducials_px)
    if (is_seen(point)) point = distortion.stored_from_ideal(point);
  for (std::optional<Eigen::Vector2d>& point : view.landmarks_px)
    if (point) point = distortion.stored_from_ideal(*point);
  return view;
}

std::string view_text(const StudyView& view, const fs::path& folder) {
  std::string text = "\n[[case.view]]\ncamera = " + toml_text(view.camera) + "\n";
  const auto add_path = [&](const char* key, const fs::path& path) {
    text += std::string(key) + " = " + toml_text(relative_if_below(path, folder)) + "\n";
  };
  add_path("xray", view.xray);
  text += view.xray_domain == XrayDomain::Intensity ? "xray_domain = \"intensity\"\n"
                                                    : "xray_domain = \"attenuation\"\n";
  if (view.is_roi_stated)
    text += "roi_px = [" + std::to_string(view.roi.column) + ", " + std::to_string(view.roi.row) +
            ", " + std::to_string(view.roi.width) + ", " + std::to_string(view.roi.height) + "]\n";
  if (!view.fiducials_px.empty()) text += "fiducials_px = " + points_text(view.fiducials_px) + "\n";
  if (!view.landmarks_px.empty())
    text +=
        "landmarks_px = [" +
        joined(view.landmarks_px,
               ", ",
               [](const auto& point) { return point ? toml_numbers(*point) : std::string("[]"); }) +
        "]\n";
  if (view.field) add_path("field", *view.field);
  const auto path_text = [&](const fs::path& path) { return relative_if_below(path, folder); };
  text += mask_text(view, path_text) + xray_keys_text(view.reading, path_text);
  return text;
}

std::string case_text(const StudyCase& study_case, const CameraRig& rig, const fs::path& folder) {
  std::string text = "\n[[case]]\nname = " + toml_text(study_case.name) + "\n";
  if (!study_case.note.empty()) text += "note = " + toml_text(study_case.note) + "\n";
  text += "ct = " + toml_text(relative_if_below(study_case.ct, folder)) + "\n";
  text += ct_keys_text(study_case.ct_reading);
  if (study_case.is_nominal_stated)
    text +=
        "nominal_room_from_ct = " + toml_matrix(study_case.nominal_room_from_ct.matrix()) + "\n";
  text += "center_ct_mm = " + toml_numbers(study_case.center_ct_mm) + "\n";
  text += "target_box_ct_mm = [" + toml_numbers(study_case.target_box_ct.low_mm) + ", " +
          toml_numbers(study_case.target_box_ct.high_mm) + "]\n";
  if (!study_case.fiducials_ct_mm.empty())
    text += "fiducials_ct_mm = " + points_text(study_case.fiducials_ct_mm) + "\n";
  if (!study_case.landmarks_ct_mm.empty())
    text += "landmarks_ct_mm = " + points_text(study_case.landmarks_ct_mm) + "\n";
  if (study_case.gold_room_from_ct)
    text += "gold_room_from_ct = " + toml_matrix(study_case.gold_room_from_ct->matrix()) + "\n";
  for (const StudyView& view : study_case.views)
    text += view_text(with_stored_points(view, rig), folder);
  return text;
}

}  // namespace

const StudyCase& Study::find_case(const std::string& name) const {
  if (const StudyCase* const found = find_row(cases, name); found != nullptr) return *found;
  if (name.empty() && cases.size() == 1) return cases.front();
  const std::string known = joined(names_of(cases));
  if (name.empty())
    throw InputError(path.string() + ": has several cases; choose one of them: " + known);
  throw InputError("case", name, "the study has only: " + known, path.string());
}

std::vector<const StudyCase*> Study::chosen_cases(const std::vector<std::string>& names) const {
  std::map<std::string, const StudyCase*> chosen;
  for (const std::string& name : names) chosen.emplace(name, &find_case(name));
  if (names.empty())
    for (const StudyCase& study_case : cases) chosen.emplace(study_case.name, &study_case);
  std::vector<const StudyCase*> result;
  result.reserve(chosen.size());
  for (const auto& [name, study_case] : chosen) result.push_back(study_case);
  return result;
}

Study read_study(const std::filesystem::path& path, std::vector<std::string>* warnings) {
  const toml::table table = read_toml_file(path);
  TomlProblems problems(path.string());
  TomlTableReader reader(table, "", problems);
  Study study;
  study.path = tidied(fs::absolute(path));
  const fs::path folder = study.path.parent_path();
  const auto rig = reader.get_string("rig", Presence::Required);
  if (!rig) problems.throw_if_any();  // without cameras nothing else can be judged
  study.rig_name_or_path = resolved_rig(*rig, folder);
  study.rig = naming_study_line({{"rig", reader.place("rig")}}, "rig", [&] {
    return read_rig(study.rig_name_or_path, warnings);
  });
  read_cases(reader, study, {folder, study.rig, problems});
  reader.refuse_unknown_keys();
  problems.throw_if_any();
  return study;
}

std::string study_to_toml(const Study& study, const std::filesystem::path& folder) {
  // A folder named with a trailing slash is the same folder.
  const fs::path absolute_folder =
      tidied(fs::absolute(folder.empty() ? fs::path("./") : folder / "")).parent_path();
  const std::vector<fs::path> rig = rig_files(study.rig_name_or_path);
  std::string text =
      "rig = " +
      toml_text(rig.empty() ? study.rig_name_or_path
                            : joined(rig,
                                     ",",
                                     [&](const fs::path& file) {
                                       return relative_if_below(file, absolute_folder);
                                     })) +
      "\n";
  for (const StudyCase& study_case : study.cases)
    text += case_text(study_case, study.rig, absolute_folder);
  return text;
}

}  // namespace af
