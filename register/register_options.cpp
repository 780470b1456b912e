// SPDX-License-Identifier: Apache-2.0
#include "register/register_options.h"

#include <algorithm>
#include <cmath>

namespace af::registration {
namespace {

void describe_start(Fields& field, RegisterOptions& options) {
  field("start_rotation_deg",
        options.start_rotation_deg,
        "Start: rx,ry,rz about the room's axes through the ROI centre, degrees, relative to the "
        "case's nominal pose (default 0,0,0)");
  field("start_translation_mm",
        options.start_translation_mm,
        "Start: tx,ty,tz along the room's axes, mm, relative to nominal (default 0,0,0)");
  field("start",
        options.start,
        "Start when no other is given: nominal; landmarks, from landmarks_ct_mm and landmarks_px; "
        "search, the likeliest poses of a whole range; auto: landmarks where there are any")
      .choice({"auto", "nominal", "landmarks", "search"});
  field.part(options.search);
  field("start_pose",
        options.start_pose,
        "Start: file with one pose as TOML, JSON, CSV or ITK text (docs/poses.md)")
      .stands_for(PathRole::InputTransform, ".tfm");
  field("starts",
        options.starts,
        "Many starts, shared by ranks: CSV with rx_deg ... tz_mm relative to nominal, or another "
        "file of poses (docs/poses.md)")
      .stands_for(PathRole::InputFile, ".csv")
      .input();
}

}  // namespace

void RegisterOptions::describe(Fields& field) {
  field("study", study, "study.toml: rig, cases, X-rays")
      .as("study,--study")
      .stands_for(PathRole::InputFile, ".toml")
      .required()
      .input();
  field("case", case_name, "Case of the study (may be left out when it has one)");
  field.part(fields);
  field(
      "renderer",
      renderer,
      "How DRRs are made: 'field' looks them up, 'raycast' casts rays through the CT; 'auto' casts "
      "rays where neither the study nor --field names a field")
      .choice({"auto", "field", "raycast"});
  field.part(method);
  field.at("seed").as("--seed");
  field.part(correction);
  field.part(uncertainty);
  describe_start(field, *this);
  field.part(attenuation);
  field.at("water_mu_per_mm").help =
      "Attenuation of water, 1/mm, for ray casting (a field has its own)";
  field.part(ray_caster);
  field.part(beam);
  field("skip_ct_check",
        skip_ct_check,
        "Do not read the CT (it may be absent): fields are trusted to be of this case");
  field.part(resume);
  field.part(pictures);
  field("require_found",
        is_found_required,
        "End with exit code 7 also when the pose is doubtful; its files are written")
      .not_deciding("results are the same");
  field("output", output_folder, "Folder for the results")
      .as("-o,--output")
      .stands_for(PathRole::OutputFolder)
      .required()
      .not_deciding("results are the same");
}

RegisterOptions RegisterOptions::in_force() const {
  RegisterOptions options = *this;
  options.method = method.in_force();
  return options;
}

std::vector<std::string> problems(const RegisterOptions& options) {
  std::vector<std::string> found = problems(options.fields);
  const bool has_parameters =
      options.start_rotation_deg.has_value() || options.start_translation_mm.has_value();
  const int ways = (has_parameters ? 1 : 0) + (options.start_pose.empty() ? 0 : 1) +
                   (options.starts.empty() ? 0 : 1);
  if (ways > 1)
    found.emplace_back(
        "start = given in several ways: use one of --start-rotation-deg/--start-translation-mm, "
        "--start-pose, --starts");
  if (ways > 0 && options.start != "auto")
    found.push_back("--start = " + options.start +
                    ": must be left out when another start is given");
  for (const auto& values : {options.start_rotation_deg, options.start_translation_mm})
    if (values.has_value())
      for (const double value : *values)
        if (!std::isfinite(value)) found.emplace_back("start = not finite: must be finite numbers");
  if (options.skip_ct_check && options.renderer == "raycast")
    found.emplace_back(
        "--skip-ct-check = set: must not be given with --renderer raycast, which needs the CT");
  if (options.correction.is_wanted && options.skip_ct_check)
    found.emplace_back(
        "--correct = set: must not be given with --skip-ct-check, because it casts rays through "
        "the CT");
  if (options.correction.is_wanted && options.renderer == "raycast")
    found.emplace_back(kCorrectsRayCasting);
  for (const std::string& text : options.start == "search"
                                     ? problems(options.search)
                                     : problems_without_search(options.search, "--start search"))
    found.push_back(text);
  for (const std::string& text : field_problems(options)) found.push_back(text);
  return found;
}

std::string renderer_of(const RegisterOptions& options, const StudyCase& study_case) {
  if (options.renderer != "auto") return options.renderer;
  const bool has_field = !options.fields.texts.empty() ||
                         std::ranges::any_of(study_case.views, [](const StudyView& view) {
                           return view.field.has_value();
                         });
  const bool needs_field = options.skip_ct_check || options.correction.is_wanted;
  return has_field || needs_field ? "field" : "raycast";
}

CaseLoadOptions case_load_options(const RegisterOptions& options,
                                  int coarsest_level,
                                  const std::vector<int>& last_levels) {
  CaseLoadOptions result;
  result.coarsest_level = coarsest_level;
  result.renderer = options.renderer == "raycast" ? RendererKind::RayCast : RendererKind::Field;
  result.field_paths = options.fields.by_camera();
  result.attenuation = options.attenuation;
  result.ray_caster = options.ray_caster;
  result.ray_caster.step_mm = options.correction.cast_step_mm(options.ray_caster.step_mm);
  result.beam = options.beam;
  result.skip_ct_check = options.skip_ct_check;
  result.fiducial_mask_mm = options.method.fiducial_mask_mm;
  if (options.correction.is_wanted) result.correction_levels = last_levels;
  return result;
}

}  // namespace af::registration
