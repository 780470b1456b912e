// SPDX-License-Identifier: Apache-2.0
#include "evaluate/simulate/simulate_options.h"

#include <cmath>
#include <filesystem>

#include "base/named_rows.h"
#include "base/number_text.h"
#include "evaluate/simulate/phantom.h"
#include "geometry/target_box.h"

namespace af::tools {

namespace {

void describe_patient(Fields& field, SimulateOptions& o) {
  field("ct", o.ct, "CT to image: DICOM folder, NIfTI, MetaImage or NRRD, in HU")
      .one_of_group("Patient");
  field("phantom", o.phantom, "Built-in synthetic patient instead of a CT. " + phantom_help())
      .choice(phantom_names())
      .one_of_group("Patient");
  describe_beside_ct(field, o.ct_reading);
  field.part(o.phantom_options);
  field("rig",
        o.rig,
        "X-ray cameras: treatment-room, c-arm-12in or a rig.toml; every camera takes one X-ray");
  field.part(o.attenuation);
  field.at("water_mu_per_mm").help =
      "Attenuation of 0 HU, 1/mm; fixes the effective energy of the HU scale";
}

void describe_output(Fields& field, SimulateOptions& o) {
  field("output", o.output, "Study folder to make; appears when complete")
      .as("-o,--output")
      .required();
  field("force", o.replaces_output, "Replace the folder if it exists");
  field("copy_ct",
        o.copies_ct,
        "Write the CT into the study as ct.nii.gz, as a phantom always is, instead of its path");
  field("xray_format",
        o.xray_format,
        "Format of the X-rays: mha; dicom: XA, MONOCHROME1, 8 to 16 bits, with the positioner's "
        "angles of the nominal pose")
      .choice({"mha", "dicom"});
  field("case", o.case_name, "Name of the case (default: from the CT's name)");
  field("seed",
        o.seed,
        "Seed of the true pose, the photon noise and the fiducial detections: same seed, same "
        "bytes");
}

void describe_target(Fields& field, SimulateOptions& o) {
  field.start_group("Target");
  field("center_ct_mm",
        o.center_ct_mm,
        "ROI centre x,y,z (LPS, mm), which the nominal pose puts at the isocentre. Default: the "
        "phantom's middle vertebra, or the bone-rich place nearest the CT's middle")
      .count(3)
      .comma_separated();
  field("target_box_ct_mm",
        o.target_box_ct_mm,
        "Box over which TRE is taken: low x,y,z, high x,y,z (LPS, mm). Default: 60 mm a side")
      .count(6)
      .comma_separated();
  field("target_bone",
        o.target_bone,
        "Phantoms only: the target is this bone, one of those that --moved-bone takes");
  field("roi_px",
        o.roi_px,
        "Width,height of the region of interest about the projected target. Default: 200,200, at "
        "most 60 % of the detector, or more for the target box")
      .at_least(16)
      .count(2)
      .comma_separated();
}

void describe_truth(Fields& field, SimulateOptions& o) {
  field.start_group("Truth");
  field("max_offset_rotation_deg",
        o.max_offset_rotation_deg,
        "The true pose is turned from the nominal one by a uniform draw of at most this about each "
        "axis, degrees")
      .within(0.0, 60.0);
  field("max_offset_translation_mm",
        o.max_offset_translation_mm,
        "... and moved by at most this along each axis, mm")
      .within(0.0, 1000.0);
  field("moved_bone",
        o.moved_bone,
        "Phantoms only: X-rays show this bone, the target, turned by 2 to 5 degrees and moved by 2 "
        "to 6 mm against the rest; the true pose is the bone's. " +
            bone_help());
  field("no_fiducials", o.omits_fiducials, "No steel pins (four of 2 x 6 mm otherwise)");
}

/// The option that names a bone as the target; empty without.
std::string bone_option(const SimulateOptions& options) {
  if (!options.moved_bone.empty()) return "moved-bone";
  return options.target_bone.empty() ? "" : "target-bone";
}

const std::string& bone_of(const SimulateOptions& options) {
  return options.moved_bone.empty() ? options.target_bone : options.moved_bone;
}

void append_scan_problems(const SimulateOptions& options, std::vector<std::string>& found) {
  const ConeBeamOptions& scan = options.cone_beam;
  if (scan.views == 0) {
    if (!scan.elevations_deg.empty())
      found.push_back("elevations_deg: apply to scans only; give --cone-beam, too");
    return;
  }
  if (!options.stress.names.empty())
    found.push_back(
        "stress: applies to studies only; a scan's X-rays have the Imaging effects alone");
  if (const std::string option = bone_option(options); !option.empty())
    found.push_back(option + ": applies to studies only; a scan's X-rays show what its CT holds");
  if (options.xray_format != "mha")
    found.push_back("xray_format = " + options.xray_format + ": a scan's X-rays are mha");
  for (const double elevation : scan.elevations_deg)
    if (!(std::abs(elevation) <= 80.0))
      found.push_back("elevations_deg = " + number_text(elevation) +
                      ": must be between -80 and 80 degrees");
}

void append_bone_problems(const SimulateOptions& options, std::vector<std::string>& found) {
  const std::string option = bone_option(options);
  if (option.empty()) return;
  if (!options.target_bone.empty() && !options.moved_bone.empty())
    found.push_back("target-bone: not with --moved-bone, whose bone is the target");
  if (options.phantom.empty()) {
    found.push_back(option + ": applies to --phantom only; a CT does not tell bones apart");
    return;
  }
  const std::vector<PhantomBone> bones = make_phantom(options.phantom, false).bones;
  if (find_row(bones, bone_of(options)) == nullptr)
    found.push_back(unknown_name_text(bones, option, bone_of(options)));
}

/// Refuses studies whose target box breaks the rule of target_box_problem().
void append_target_problems(const SimulateOptions& options, std::vector<std::string>& found) {
  for (const double value : options.center_ct_mm)
    if (!std::isfinite(value)) found.push_back("center_ct_mm must be finite");
  const std::vector<double>& box = options.target_box_ct_mm;
  if (box.size() == 6)
    if (const std::string problem =
            target_box_problem({{box[0], box[1], box[2]}, {box[3], box[4], box[5]}});
        !problem.empty())
      found.push_back("target_box_ct_mm: " + problem);
}

}  // namespace

XraySimulationOptions SimulateOptions::xray_in_force() const {
  XraySimulationOptions in_force = is_ideal ? XraySimulationOptions::ideal() : xray;
  in_force.threads = xray.threads;
  in_force.detector = stress.detector(in_force.detector);
  return in_force;
}

std::string SimulateOptions::case_name_in_force() const {
  if (!case_name.empty()) return case_name;
  if (!phantom.empty() && phantom_options.anatomy_seed)
    return phantom + "-" + std::to_string(*phantom_options.anatomy_seed);
  if (!phantom.empty()) return phantom + "-phantom";
  std::filesystem::path path = std::filesystem::absolute(ct).lexically_normal();
  if (!path.has_filename()) path = path.parent_path();
  const std::string name = path.filename().string();
  const std::string stem = name.substr(0, name.find('.', 1));
  return stem.empty() ? "case" : stem;
}

std::vector<std::string> problems(const SimulateOptions& options) {
  std::vector<std::string> found = field_problems(options);
  if (options.phantom_options.has_metal && options.phantom.empty())
    found.push_back("metal: applies to --phantom only; a CT has its own metal or none");
  if (options.phantom_options.anatomy_seed && options.phantom.empty())
    found.push_back("anatomy-seed: applies to --phantom only; a CT is of one patient");
  append_bone_problems(options, found);
  append_target_problems(options, found);
  append_scan_problems(options, found);
  const int bits = options.xray_in_force().detector.bits;
  if (options.xray_format == "dicom" && (bits < 8 || bits > 16))
    found.push_back("xray_format = dicom: needs 8 to 16 bits, not " + std::to_string(bits) +
                    (bits == 0 ? " (none: floats)" : ""));
  if (options.case_name.find_first_of("/\\\"\n") != std::string::npos)
    found.push_back("case = " + options.case_name + ": must not hold / \\ \" or line ends");
  return found;
}

Phantom phantom_of(const SimulateOptions& options) {
  Phantom phantom = make_phantom(
      options.phantom, options.phantom_options.has_metal, options.phantom_options.anatomy_seed);
  if (const std::string option = bone_option(options); !option.empty())
    phantom.target = required_row(phantom.bones, option, bone_of(options)).target;
  return phantom;
}

void ConeBeamOptions::describe(Fields& field) {
  field("cone_beam",
        views,
        "Write a scan for af-scan: this many X-rays on a circle about the CT's centre, by the "
        "rig's first camera; 0: a study")
      .within(0, 100000);
  field(
      "elevations_deg",
      elevations_deg,
      "Also write elevated.toml: X-rays without noise from these angles above the circle, degrees, "
      "e.g. 0,2,8, to judge predictions by")
      .comma_separated();
  field("elevated_views",
        elevated_views,
        "X-rays per elevation, at the angles of odd views around the first")
      .within(1, 1000);
}

void SimulateOptions::describe(Fields& field) {
  describe_patient(field, *this);
  describe_output(field, *this);
  describe_target(field, *this);
  describe_truth(field, *this);
  field.start_group("Imaging (0 switches an effect off)");
  field(
      "ideal", is_ideal, "All effects off, float pixels; with --no-fiducials pure line integrals");
  field.start_group("");
  field.part(xray);
  field.start_group("Stress (effects in real X-rays)");
  field.part(stress);
  field.start_group("Cone-beam scan (instead of a study)");
  field.part(cone_beam);
  // Files of studies use these names.
  field.name_like_options();
}

}  // namespace af::tools
