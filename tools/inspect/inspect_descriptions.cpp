// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "ct/ct_facts.h"
#include "drr/field_coverage.h"
#include "files/csv_table.h"
#include "files/json_text.h"
#include "files/output_file.h"
#include "files/sha256.h"
#include "study/node_ct.h"
#include "study/pose_file.h"
#include "study/rig_file.h"
#include "study/study_file.h"
#include "study/target_place.h"
#include "study/xray_reader.h"
#include "tools/inspect/inspect_kinds.h"
#include "xray/image_file.h"

namespace af {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

namespace {

/// A registration that ends this near counts as a success (the paper's limit).
constexpr double kSuccessTreMm = 2.5;

ordered_json camera_json(const CameraGeometry& camera, const Eigen::Vector3d& isocenter_point) {
  ordered_json json;
  json["name"] = camera.name;
  json["size_px"] = {camera.size_px.x(), camera.size_px.y()};
  json["pixel_spacing_mm"] = vector_json(camera.pixel_spacing_mm);
  json["source_point_mm"] = vector_json(camera.source_point);
  json["source_detector_distance_mm"] = camera.source_detector_distance_mm();
  json["source_isocenter_distance_mm"] = (isocenter_point - camera.source_point).norm();
  json["beam_direction"] = vector_json(camera.beam_direction());
  json["isocenter_at_px"] = vector_json(camera.project(isocenter_point));
  json["mirrored"] = camera.is_mirrored();
  if (!camera.distortion.is_none())
    json["distortion"] =
        std::vector<double>(camera.distortion.coefficients.begin(),
                            camera.distortion.coefficients.begin() +
                                static_cast<std::ptrdiff_t>(camera.distortion.count()));
  return json;
}

using AreUsedTogether = std::function<bool(const std::string& camera, const std::string& other)>;

ordered_json rig_json(const CameraRig& rig, const AreUsedTogether& are_used_together) {
  ordered_json json;
  json["isocenter_point_mm"] = vector_json(rig.isocenter_point);
  for (const CameraGeometry& camera : rig.cameras)
    json["cameras"].push_back(camera_json(camera, rig.isocenter_point));
  for (std::size_t a = 0; a < rig.cameras.size(); ++a)
    for (std::size_t b = a + 1; b < rig.cameras.size(); ++b) {
      if (!are_used_together(rig.cameras[a].name, rig.cameras[b].name)) continue;
      const double cosine = rig.cameras[a].beam_direction().dot(rig.cameras[b].beam_direction());
      json["angles_between_beams_deg"].push_back(
          {{"cameras", {rig.cameras[a].name, rig.cameras[b].name}},
           {"angle_deg", std::acos(std::clamp(cosine, -1.0, 1.0)) * kDegPerRad}});
    }
  return json;
}

/// Whether any case has X-rays of both cameras.
bool have_common_case(const Study& study, const std::string& camera, const std::string& other) {
  const auto has = [](const StudyCase& study_case, const std::string& name) {
    return std::any_of(study_case.views.begin(),
                       study_case.views.end(),
                       [&](const StudyView& view) { return view.camera == name; });
  };
  return std::any_of(study.cases.begin(), study.cases.end(), [&](const StudyCase& study_case) {
    return has(study_case, camera) && has(study_case, other);
  });
}

/// Whether the field of a view belongs to the case's CT. Also says what it covers of the rays that
/// registrations look at, which are those of twice its region, about the case's nominal pose.
void describe_field(const StudyCase& study_case,
                    const StudyView& view,
                    const CameraGeometry& camera,
                    const CtIdentity& ct,
                    ordered_json& json,
                    std::vector<std::string>& warnings) {
  try {
    const HeldRays field = read_held_rays(*view.field);
    require_same_ct(view.field->string(), ct, study_case.ct.string(), field.identity.ct);
    const View needed = View{camera, view.roi}.scaled(kWidestRegionScale);
    const ViewReach reach = field.coverage.reach(needed, study_case.frame(), field.identity.range);
    json["field_camera"] = reach.distance;
    json["field_coverage"] = reach.text(camera.name);
    if (reach.held < reach.rays)
      warnings.push_back("field " + view.field->string() + " misses " +
                         std::to_string(reach.rays - reach.held) + " of " +
                         std::to_string(reach.rays) + " rays of camera " + camera.name +
                         " at the nominal pose that registrations need, those of twice the region");
  } catch (const Error& error) {
    warnings.push_back("field " + view.field->string() + " cannot be used: " + error.what());
  }
}

ordered_json view_json(const StudyCase& study_case,
                       const StudyView& view,
                       const CameraRig& rig,
                       const CtIdentity& ct,
                       std::vector<std::string>& warnings) {
  ordered_json json;
  json["camera"] = view.camera;
  json["xray"] = view.xray.string();
  json["xray_domain"] = view.xray_domain == XrayDomain::Intensity ? "intensity" : "attenuation";
  // Without roi_px, view.roi is the whole detector, which registrations hardly ever compare.
  if (view.is_roi_stated)
    json["roi_px"] = {view.roi.column, view.roi.row, view.roi.width, view.roi.height};
  else
    json["region"] =
        "the target box and a quarter of its sides; with --region study the whole detector";
  // Only those that the view shows count.
  json["fiducials"] = std::count_if(view.fiducials_px.begin(),
                                    view.fiducials_px.end(),
                                    [](const Eigen::Vector2d& point) { return point.allFinite(); });
  const CameraGeometry& camera = rig.camera(view.camera);
  ViewXray xray = read_view_xray(view, camera);
  json["xray_reading"] = xray.note;
  for (std::string& warning : xray.warnings) warnings.push_back(std::move(warning));
  if (!view.field) return json;
  json["field"] = view.field->string();
  // A study is written before its fields are made.
  if (fs::exists(*view.field))
    describe_field(study_case, view, camera, ct, json, warnings);
  else
    warnings.push_back("field " + view.field->string() +
                       " does not exist yet; af-precompute --study ... --camera " + view.camera +
                       " -o makes it");
  return json;
}

ordered_json case_json(const StudyCase& study_case,
                       const CameraRig& rig,
                       std::vector<std::string>& warnings) {
  ordered_json json;
  json["name"] = study_case.name;
  json["ct"] = study_case.ct.string();
  if (const std::string reading = study_case.ct_reading.text(); !reading.empty())
    json["ct_reading"] = reading;
  const CtFacts ct = naming_study_line(study_case.places, "ct", [&] {
    return read_ct_facts(study_case.ct, study_case.ct_reading, {}, warnings);
  });
  require_target_in_ct(study_case, ct.grid);
  json["center_ct_mm"] = vector_json(study_case.center_ct_mm);
  for (Eigen::Index row = 0; row < 4; ++row)
    json["nominal_room_from_ct"].push_back(
        vector_json(study_case.nominal_room_from_ct.matrix().row(row).transpose()));
  json["target_box_ct_mm"] = {vector_json(study_case.target_box_ct.low_mm),
                              vector_json(study_case.target_box_ct.high_mm)};
  json["fiducials"] = study_case.fiducials_ct_mm.size();
  json["has_gold_pose"] = study_case.gold_room_from_ct.has_value();
  for (const StudyView& view : study_case.views)
    json["views"].push_back(view_json(study_case, view, rig, ct.identity, warnings));
  return json;
}

double median_of(std::vector<double> values) {
  if (values.empty()) return std::nan("");
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>((values.size() - 1) / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

ordered_json finite_or_null(double value) {
  return std::isfinite(value) ? ordered_json(value) : ordered_json(nullptr);
}

/// Numbers of a column; cells such as "nan" and "inf" are left out.
std::vector<double> finite_cells(const CsvTable& table, const std::string& column) {
  static const std::set<std::string> not_finite = {"", "nan", "-nan", "inf", "-inf"};
  std::vector<double> values;
  for (std::size_t row = 0; row < table.row_count(); ++row)
    if (!not_finite.contains(table.text(row, column))) values.push_back(table.number(row, column));
  return values;
}

bool has_columns(const CsvTable& table, const std::vector<std::string>& columns) {
  return std::all_of(columns.begin(), columns.end(), [&](const std::string& column) {
    return table.find_column(column).has_value();
  });
}

void describe_registrations(const CsvTable& table, Inspection& inspection) {
  inspection.kind = "registrations";
  std::map<std::string, std::map<std::string, std::size_t>> counts;
  for (std::size_t row = 0; row < table.row_count(); ++row)
    for (const char* column : {"case", "renderer", "stop_reason"})
      ++counts[column][table.text(row, column)];
  const std::vector<double> errors = finite_cells(table, "tre_mm");
  inspection.facts["rows"] = table.row_count();
  inspection.facts["rows_by"] = counts;
  inspection.facts["with_tre"] = errors.size();
  inspection.facts["median_tre_mm"] = finite_or_null(median_of(errors));
  inspection.facts["tre_below_2.5_mm"] = std::count_if(
      errors.begin(), errors.end(), [](double error) { return error < kSuccessTreMm; });
}

void describe_image_quality(const CsvTable& table, Inspection& inspection) {
  inspection.kind = "image quality";
  std::vector<double> psnr = finite_cells(table, "psnr_db");
  inspection.facts["poses"] = table.row_count();
  inspection.facts["with_finite_psnr"] = psnr.size();
  inspection.facts["median_psnr_db"] = finite_or_null(median_of(psnr));
  inspection.facts["min_psnr_db"] = psnr.empty()
                                        ? ordered_json(nullptr)
                                        : ordered_json(*std::min_element(psnr.begin(), psnr.end()));
}

/// Copies what is short and simple. Long arrays become their length.
ordered_json shortened(const ordered_json& json) {
  constexpr std::size_t kMaxArray = 16;
  if (json.is_array() && json.size() > kMaxArray) return std::to_string(json.size()) + " entries";
  if (!json.is_object()) return json;
  ordered_json result = ordered_json::object();
  for (const auto& [key, value] : json.items()) result[key] = shortened(value);
  return result;
}

}  // namespace

ordered_json vector_json(const Eigen::Ref<const Eigen::VectorXd>& vector) {
  // Adding 0 turns -0 into 0.
  const Eigen::VectorXd plain = vector.array() + 0.0;
  return std::vector<double>(plain.begin(), plain.end());
}

void inspect_rig(const std::string& name_or_path, Inspection& inspection) {
  inspection.kind = "rig";
  inspection.facts = rig_json(read_rig(name_or_path, &inspection.warnings),
                              [](const auto& /*camera*/, const auto& /*other*/) { return true; });
}

void inspect_study(const fs::path& path, Inspection& inspection) {
  inspection.kind = "study";
  const Study study = read_study(path, &inspection.warnings);
  inspection.facts["rig"] = rig_json(study.rig, [&](const auto& camera, const auto& other) {
    return have_common_case(study, camera, other);
  });
  for (const StudyCase& study_case : study.cases)
    inspection.facts["cases"].push_back(case_json(study_case, study.rig, inspection.warnings));
}

void inspect_pose(const fs::path& path, Inspection& inspection) {
  inspection.kind = "pose";
  const PoseFileBytes file = read_pose_bytes(path);
  const PoseFormat& format = format_of_pose_file(file);
  inspection.facts["format"] = format.name;
  const PosesInFile found = format.read(file, {PoseFrame{}, {}});
  inspection.warnings.insert(inspection.warnings.end(), found.notes.begin(), found.notes.end());
  if (found.poses.size() != 1) {
    inspection.facts["poses"] = found.poses.size();
    return;
  }
  const RigidTransform& room_from_ct = found.poses.front().room_from_ct;
  const Eigen::Matrix4d& matrix = room_from_ct.matrix();
  for (Eigen::Index row = 0; row < 4; ++row)
    inspection.facts["room_from_ct"].push_back(vector_json(matrix.row(row).transpose()));
  inspection.facts["rotation_deg"] =
      vector_json(angles_from_rotation(room_from_ct.linear()) * kDegPerRad);
}

void inspect_csv(const fs::path& path, Inspection& inspection) {
  inspection.kind = "table";
  const CsvTable table = CsvTable::read(path);
  inspection.facts["columns"] = table.columns();
  inspection.facts["file_sha256"] = sha256_of_file(path.string());
  if (has_columns(table, {"case", "start_index", "renderer", "tre_mm", "stop_reason"}))
    return describe_registrations(table, inspection);
  if (has_columns(table, {"pose_index", "psnr_db"}))
    return describe_image_quality(table, inspection);
  if (has_columns(table, {"rx_deg", "ry_deg", "rz_deg", "tx_mm", "ty_mm", "tz_mm"}) ||
      has_columns(table, {"m00", "m23"})) {
    inspection.kind = "poses";
    // The frame only gives the parameters a place, so any frame is good enough to check them.
    inspection.facts["poses"] = read_pose_file(path, {PoseFrame{}, {}}).poses.size();
    return;
  }
  throw InputError(path.string() +
                   ": a table, but none of registrations.csv, image-quality.csv or poses "
                   "(rx_deg ... tz_mm, or m00 ... m23), by its columns");
}

void inspect_json(const fs::path& path, Inspection& inspection) {
  inspection.kind = "JSON";
  const ordered_json json = ordered_json_of_text(read_text_file(path), path.string());
  if (!json.is_object()) throw InputError(path.string() + ": JSON, but no object");
  inspection.facts = shortened(json);
  if (json.contains("format") && json["format"].is_string())
    inspection.kind = json["format"].get<std::string>();
  else if (json.contains("room_from_ct"))
    inspection.kind = "pose";
  else
    throw InputError(path.string() +
                     ": JSON, but no result of this project (no 'format', no 'room_from_ct')");
  if (json.contains("room_from_ct")) (void)read_pose(path);
}

}  // namespace af
