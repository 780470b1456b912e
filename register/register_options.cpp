// SPDX-License-Identifier: Apache-2.0
#include "register/register_options.h"

#include <cmath>
#include <sstream>

#include <CLI/CLI.hpp>

#include "base/error.h"
#include "base/toml_text.h"
#include "cli/run_limits.h"
#include "files/sha256.h"
#include "register/method_arguments.h"
#include "study/pose_file.h"
#include "text/csv_table.h"

namespace af::registration {
namespace {

/// CAMERA and PATH of "CAMERA=PATH"; nullopt when it is not of that form.
std::optional<std::pair<std::string, std::string>> split_field(const std::string& text) {
  const std::size_t equals = text.find('=');
  if (equals == std::string::npos || equals == 0 || equals + 1 == text.size()) return std::nullopt;
  return std::pair(text.substr(0, equals), text.substr(equals + 1));
}

std::string triple(const std::array<double, 3>& values) {
  return "[" + number_text(values[0]) + ", " + number_text(values[1]) + ", " +
         number_text(values[2]) + "]";
}

void bind_start(CLI::App& app, RegisterOptions& options) {
  app.add_option("--start-rotation-deg",
                 options.start_rotation_deg,
                 "Start: rx,ry,rz about the room's axes through the ROI centre, degrees, relative "
                 "to the case's nominal pose (default 0,0,0)")
      ->delimiter(',');
  app.add_option("--start-translation-mm",
                 options.start_translation_mm,
                 "Start: tx,ty,tz along the room's axes, mm, relative to nominal (default 0,0,0)")
      ->delimiter(',');
  app.add_option("--start-pose",
                 options.start_pose,
                 "Start: file with room_from_ct (TOML, JSON, ITK .tfm or 16 numbers)");
  app.add_option("--starts",
                 options.starts,
                 "CSV of many starts: rx_deg,ry_deg,rz_deg,tx_mm,ty_mm,tz_mm relative to nominal, "
                 "or m00 ... m23 of room_from_ct; under mpirun the ranks share them");
}

void bind_renderer(CLI::App& app, RegisterOptions& options) {
  app.add_option("--renderer",
                 options.renderer,
                 "How DRRs are made: 'field' looks them up, 'raycast' casts rays through the CT")
      ->check(CLI::IsMember({"field", "raycast"}))
      ->capture_default_str();
  bind_method(app, options.method);
  app.add_option("--seed", options.method.seed, "Seed of the random numbers that cma-es draws")
      ->capture_default_str();
}

}  // namespace

void bind_options(CLI::App& app, RegisterOptions& options) {
  app.add_option("--study", options.study, "study.toml: rig, cases, X-rays")->required();
  app.add_option(
      "--case", options.case_name, "Case of the study (may be left out when it has one)");
  app.add_option("--field",
                 options.fields,
                 "CAMERA=FIELD.h5, once per camera; replaces the study's `field`")
      ->allow_extra_args(false);
  bind_renderer(app, options);
  bind_start(app, options);
  app.add_option("--water-mu-per-mm",
                 options.water_mu_per_mm,
                 "Attenuation of water, 1/mm, for ray casting (a field has its own)")
      ->capture_default_str();
  app.add_option("--step-mm", options.step_mm, "Longest step of ray casting, mm")
      ->capture_default_str();
  app.add_option(
      "--series", options.series_uid, "DICOM series UID, when the CT's folder has several");
  app.add_flag("--skip-ct-check",
               options.skip_ct_check,
               "Do not read the CT (it may be absent): fields are trusted to be of this case");
  cli::bind_resume(app, options.restarts);
  app.add_option("-o,--output", options.output_folder, "Folder for the results")->required();
}

std::vector<std::string> problems(const RegisterOptions& options) {
  std::vector<std::string> found;
  for (std::size_t i = 0; i < options.fields.size(); ++i) {
    const auto field = split_field(options.fields[i]);
    if (!field.has_value()) {
      found.push_back("--field = '" + options.fields[i] + "': must be CAMERA=PATH");
      continue;
    }
    for (std::size_t j = 0; j < i; ++j)
      if (const auto other = split_field(options.fields[j]);
          other.has_value() && other->first == field->first)
        found.push_back("--field = '" + options.fields[i] + "': camera '" + field->first +
                        "' is given twice");
  }
  const bool has_parameters =
      options.start_rotation_deg.has_value() || options.start_translation_mm.has_value();
  const int ways = (has_parameters ? 1 : 0) + (options.start_pose.empty() ? 0 : 1) +
                   (options.starts.empty() ? 0 : 1);
  if (ways > 1)
    found.emplace_back(
        "start = given in several ways: use one of --start-rotation-deg/--start-translation-mm, "
        "--start-pose, --starts");
  for (const auto& values : {options.start_rotation_deg, options.start_translation_mm})
    if (values.has_value())
      for (const double value : *values)
        if (!std::isfinite(value)) found.emplace_back("start = not finite: must be finite numbers");
  if (options.skip_ct_check && options.renderer == "raycast")
    found.emplace_back("--skip-ct-check = set: ray casting needs the CT; leave it out");
  AttenuationModel model;
  model.mu_water_per_mm = options.water_mu_per_mm;
  for (const std::string& text : af::problems(model)) found.push_back(text);
  for (const std::string& text : af::problems(RayCasterOptions{options.step_mm}))
    found.push_back(text);
  return found;
}

CaseLoadOptions case_load_options(const RegisterOptions& options, int coarsest_level) {
  CaseLoadOptions result;
  result.coarsest_level = coarsest_level;
  result.renderer = options.renderer == "raycast" ? RendererKind::RayCast : RendererKind::Field;
  for (const std::string& text : options.fields)
    if (const auto field = split_field(text); field.has_value())
      result.field_paths[field->first] = field->second;
  result.ct.series_uid = options.series_uid;
  result.water_mu_per_mm = options.water_mu_per_mm;
  result.ray_caster.step_mm = options.step_mm;
  result.skip_ct_check = options.skip_ct_check;
  result.fiducial_mask_mm = options.method.fiducial_mask_mm;
  return result;
}

std::vector<RigidTransform> start_poses(const RegisterOptions& options, const PoseFrame& frame) {
  if (!options.starts.empty()) return read_poses_csv(options.starts, frame);
  if (!options.start_pose.empty()) return {read_pose(options.start_pose)};
  std::array<double, 6> values{};
  for (std::size_t i = 0; i < 3; ++i) {
    if (options.start_rotation_deg.has_value()) values[i] = (*options.start_rotation_deg)[i];
    if (options.start_translation_mm.has_value())
      values[i + 3] = (*options.start_translation_mm)[i];
  }
  return {pose_of_deg_and_mm(frame, values, "--start-rotation-deg, --start-translation-mm")};
}

std::map<std::string, std::string> hashes_of_files(const RegisterOptions& options) {
  std::map<std::string, std::string> hashes = {{"study", sha256_of_file(options.study.string())}};
  if (!options.starts.empty()) hashes["starts"] = sha256_of_file(options.starts.string());
  return hashes;
}

std::string to_toml(const RegisterOptions& options, const RegistrationOptions& registration) {
  std::ostringstream out;
  out << "study = " << toml_text(options.study.string()) << '\n'
      << "case = " << toml_text(options.case_name) << '\n'
      << "renderer = " << toml_text(options.renderer) << '\n'
      << "water_mu_per_mm = " << number_text(options.water_mu_per_mm) << '\n'
      << "step_mm = " << number_text(options.step_mm) << '\n'
      << "skip_ct_check = " << (options.skip_ct_check ? "true" : "false") << '\n';
  if (!options.series_uid.empty()) out << "series = " << toml_text(options.series_uid) << '\n';
  // No key: the fields' content decides, see input_sha256.
  for (const std::string& field : options.fields) {
    const std::string quoted = toml_text(field);
    out << "# --field " << quoted.substr(1, quoted.size() - 2) << '\n';
  }
  if (options.start_rotation_deg.has_value())
    out << "start_rotation_deg = " << triple(*options.start_rotation_deg) << '\n';
  if (options.start_translation_mm.has_value())
    out << "start_translation_mm = " << triple(*options.start_translation_mm) << '\n';
  if (!options.start_pose.empty())
    out << "start_pose = " << toml_text(options.start_pose.string()) << '\n';
  if (!options.starts.empty()) out << "starts = " << toml_text(options.starts.string()) << '\n';
  out << to_toml(options.method, registration);
  return out.str();
}

}  // namespace af::registration
