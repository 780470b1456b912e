// SPDX-License-Identifier: Apache-2.0
#include "register/register_command.h"

#include <cmath>
#include <sstream>

#include "base/error.h"
#include "io/csv_table.h"
#include "io/pose_file.h"

namespace af::registration {
namespace {

/// CAMERA and PATH of "CAMERA=PATH"; nullopt when it is not of that form.
std::optional<std::pair<std::string, std::string>> split_field(const std::string& text) {
  const std::size_t equals = text.find('=');
  if (equals == std::string::npos || equals == 0 || equals + 1 == text.size()) return std::nullopt;
  return std::pair(text.substr(0, equals), text.substr(equals + 1));
}

std::string quoted(const std::string& text) {
  std::string result = "\"";
  for (const char character : text) {
    if (character == '"' || character == '\\') result += '\\';
    result += character;
  }
  return result + "\"";
}

std::string triple(const std::array<double, 3>& values) {
  return "[" + number_text(values[0]) + ", " + number_text(values[1]) + ", " +
         number_text(values[2]) + "]";
}

}  // namespace

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
  return {pose_from_parameters(frame, PoseParameters::from_deg_and_mm(values))};
}

std::string to_toml(const RegisterOptions& options, const RegistrationOptions& registration) {
  std::ostringstream out;
  out << "study = " << quoted(options.study.string()) << '\n'
      << "case = " << quoted(options.case_name) << '\n'
      << "renderer = " << quoted(options.renderer) << '\n'
      << "water_mu_per_mm = " << number_text(options.water_mu_per_mm) << '\n'
      << "step_mm = " << number_text(options.step_mm) << '\n'
      << "skip_ct_check = " << (options.skip_ct_check ? "true" : "false") << '\n';
  for (const std::string& field : options.fields) out << "# --field " << field << '\n';
  if (options.start_rotation_deg.has_value())
    out << "start_rotation_deg = " << triple(*options.start_rotation_deg) << '\n';
  if (options.start_translation_mm.has_value())
    out << "start_translation_mm = " << triple(*options.start_translation_mm) << '\n';
  if (!options.start_pose.empty())
    out << "start_pose = " << quoted(options.start_pose.string()) << '\n';
  if (!options.starts.empty()) out << "starts = " << quoted(options.starts.string()) << '\n';
  out << to_toml(options.method, registration);
  return out.str();
}

}  // namespace af::registration
