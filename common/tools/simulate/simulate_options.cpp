// SPDX-License-Identifier: Apache-2.0
#include "tools/simulate/simulate_options.h"

#include <cmath>
#include <filesystem>

#include <CLI/CLI.hpp>

#include "simulation/range_check.h"

namespace af::tools {

namespace {

void bind_input(CLI::App& app, SimulateOptions& o) {
  auto* input = app.add_option_group("Patient", "exactly one of");
  input->add_option("--ct", o.ct, "CT to image: DICOM folder, NIfTI, MetaImage or NRRD, in HU");
  input
      ->add_option(
          "--phantom",
          o.phantom,
          "Built-in synthetic patient instead of a CT: spine (trunk from T8 to L4 with ribs "
          "and organs), pelvis (L4 to the upper thighs) or head (vault to C4)")
      ->check(CLI::IsMember(phantom_names()));
  input->require_option(1);
  app.add_option("--series", o.series_uid, "UID of the DICOM series, when the folder has several");
  app.add_option("--phantom-voxel-mm", o.phantom_options.voxel_mm, "Voxel side of the phantom, mm")
      ->capture_default_str();
  app.add_flag("--metal",
               o.phantom_options.has_metal,
               "Phantoms only: with pedicle screws and rods (spine), a hip prosthesis (pelvis) or "
               "fillings and a plate (head). The X-rays show metal as dense as it is, the CT clips "
               "it at 3071 HU as scanners do");
  app.add_option("--rig",
                 o.rig,
                 "X-ray cameras: treatment-room, c-arm-12in or a rig.toml; every camera takes one "
                 "X-ray")
      ->capture_default_str();
  app.add_option("--water-mu-per-mm",
                 o.attenuation.mu_water_per_mm,
                 "Attenuation at 0 HU, 1/mm; fixes the effective energy of the HU scale")
      ->capture_default_str();
}

void bind_output(CLI::App& app, SimulateOptions& o) {
  app.add_option("-o,--output",
                 o.output,
                 "Study folder to make: study.toml, rig.toml, truth.toml, one X-ray per camera, "
                 "previews, provenance.json, reproduce.sh. Appears when complete")
      ->required();
  app.add_flag("--force", o.replaces_output, "Replace the folder if it exists");
  app.add_flag("--copy-ct",
               o.copies_ct,
               "Write the CT into the study as ct.nii.gz; otherwise a --ct is referred to by its "
               "absolute path (a phantom is always written)");
  app.add_option("--case", o.case_name, "Name of the case (default: from the CT's name)");
  app.add_option("--seed",
                 o.seed,
                 "Seed of the true pose, the photon noise and the fiducial detections: same seed, "
                 "same bytes")
      ->capture_default_str();
}

void bind_target(CLI::App& app, SimulateOptions& o) {
  const std::string group = "Target";
  app.add_option(
         "--center-ct-mm",
         o.center_ct_mm,
         "ROI centre x,y,z in ct coordinates (LPS, mm), placed at the isocentre by the "
         "nominal pose. Default: the middle vertebra of the phantom; of a CT, the bone-rich "
         "place nearest its middle")
      ->expected(3)
      ->delimiter(',')
      ->group(group);
  app.add_option("--target-box-ct-mm",
                 o.target_box_ct_mm,
                 "Box over which TRE is taken: low x,y,z, high x,y,z (LPS, mm)")
      ->expected(6)
      ->delimiter(',')
      ->group(group);
  app.add_option("--target-side-mm", o.target_side_mm, "Side of the automatic target box, mm")
      ->capture_default_str()
      ->group(group);
  app.add_option("--roi-px",
                 o.roi_px,
                 "Width,height of the region of interest on each detector, centred on the "
                 "projected target. Default: 200,200 (at most 60 % of the detector), more if "
                 "the projected box needs it")
      ->expected(2)
      ->delimiter(',')
      ->group(group);
}

void bind_truth(CLI::App& app, SimulateOptions& o) {
  const std::string group = "Truth";
  app.add_option("--max-offset-rotation-deg",
                 o.max_offset_rotation_deg,
                 "The true pose is turned from the nominal one by a uniform draw of at most this "
                 "about each axis, degrees")
      ->capture_default_str()
      ->group(group);
  app.add_option("--max-offset-translation-mm",
                 o.max_offset_translation_mm,
                 "... and moved by at most this along each axis, mm")
      ->capture_default_str()
      ->group(group);
  app.add_flag("!--no-fiducials", o.has_fiducials, "No steel pins (four of 2 x 6 mm otherwise)")
      ->group(group);
  app.add_option("--fiducial-sigma-px",
                 o.fiducial_sigma_px,
                 "Standard deviation of fiducial detections in column and row, px")
      ->capture_default_str()
      ->group(group);
}

void bind_imaging(CLI::App& app, SimulateOptions& o) {
  const std::string group = "Imaging (0 switches an effect off)";
  SpectrumOptions& spectrum = o.xray.spectrum;
  DetectorOptions& detector = o.xray.detector;
  const auto add = [&](const std::string& name, auto& value, const std::string& text) {
    app.add_option(name, value, text)->capture_default_str()->group(group);
  };
  app.add_flag("--ideal",
               o.is_ideal,
               "All effects off: one energy, no scatter, noise, blur or quantisation; float "
               "pixels. Use with --no-fiducials for pure line integrals")
      ->group(group);
  add("--tube-kvp", spectrum.tube_kvp, "Tube voltage, kV; 0: only the HU scale's effective energy");
  add("--aluminium-mm", spectrum.aluminium_mm, "Filtration, mm of aluminium");
  add("--energy-bins", spectrum.energy_bins, "Energy bins of the spectrum, at least 20");
  add("--scatter-to-primary",
      detector.scatter_to_primary_ratio,
      "Mean scatter / mean primary within the region of interest");
  add("--scatter-sigma-mm", detector.scatter_sigma_mm, "Width of the scatter kernel, mm");
  add("--photons-per-pixel",
      detector.photons_per_pixel,
      "Photons per pixel in the open beam, for Poisson noise");
  add("--blur-sigma-px", detector.blur_sigma_px, "Gaussian detector blur, px");
  add("--bits", detector.bits, "Grey level bits, 8 to 16; 0: float pixels");
  add("--open-beam-level",
      detector.open_beam_level,
      "Grey level of the open beam; beyond the bits it saturates");
  add("--rays-per-pixel-side", o.xray.rays_per_pixel_side, "n: a pixel is the mean of n x n rays");
  app.add_option("--threads",
                 o.xray.threads,
                 "Threads (0: all of the machine); results do not depend on them")
      ->capture_default_str();
}

void bind_stress(CLI::App& app, SimulateOptions& o) {
  const std::string group =
      "Stress (what real X-rays have; strengths count only where named by --stress)";
  StressOptions& stress = o.stress;
  const auto add = [&](const std::string& name, auto& value, const std::string& text) {
    app.add_option(name, value, text)->capture_default_str()->group(group);
  };
  app.add_option(
         "--stress",
         stress.names,
         "Comma separated: rods, fiducials (steel in the X-rays, not in the CT), heel (ramp "
         "over the detector), scatter (heavy, from the open beam too), noise, degraded-ct "
         "(the study's CT; X-rays show the good one), calibration (the study's rig is "
         "slightly wrong), motion (non-rigid, away from the target); or all")
      ->delimiter(',')
      ->check(CLI::IsMember(stress_names()))
      ->group(group);
  add("--rod-count", stress.occluders.rod_count, "rods: how many");
  add("--rod-diameter-mm", stress.occluders.rod_diameter_mm, "rods: diameter, mm");
  add("--rod-length-mm", stress.occluders.rod_length_mm, "rods: length, mm");
  add("--ball-count", stress.occluders.ball_count, "fiducials: how many balls");
  add("--ball-diameter-mm", stress.occluders.ball_diameter_mm, "fiducials: diameter, mm");
  add("--heel-ramp", stress.heel_ramp, "heel: share by which the beam varies, 0.25 for +-25 %");
  add("--open-scatter-to-primary",
      stress.scatter_to_primary_ratio,
      "scatter: mean scatter / mean primary within the region of interest");
  add("--noisy-photons-per-pixel",
      stress.photons_per_pixel,
      "noise: photons per pixel in the open beam");
  add("--ct-slice-mm",
      stress.degraded_ct.slice_mm,
      "degraded-ct: slices are averaged in groups of about this thickness, mm");
  add("--ct-noise-hu", stress.degraded_ct.noise_hu, "degraded-ct: noise, HU");
  add("--ct-step-hu", stress.degraded_ct.step_hu, "degraded-ct: steps of the values, HU");
  add("--calibration-error-px",
      stress.calibration_error_px,
      "calibration: RMS shift of the target box's projections, px");
  add("--motion-mm", stress.motion.amplitude_mm, "motion: largest displacement along an axis, mm");
  add("--motion-wavelength-mm", stress.motion.wavelength_mm, "motion: wavelength, mm");
  add("--motion-margin-mm",
      stress.motion.margin_mm,
      "motion: margin around the target box that stays still, mm");
  add("--motion-ramp-mm",
      stress.motion.ramp_mm,
      "motion: distance over which the displacement grows to its full size, mm");
}

}  // namespace

XraySimulationOptions SimulateOptions::xray_in_force() const {
  XraySimulationOptions in_force = is_ideal ? XraySimulationOptions::ideal() : xray;
  in_force.threads = xray.threads;
  in_force.rays_per_pixel_side = xray.rays_per_pixel_side;
  in_force.detector = stress.detector(in_force.detector);
  return in_force;
}

std::string SimulateOptions::case_name_in_force() const {
  if (!case_name.empty()) return case_name;
  if (!phantom.empty()) return phantom + "-phantom";
  std::filesystem::path path = std::filesystem::absolute(ct).lexically_normal();
  if (!path.has_filename()) path = path.parent_path();
  const std::string name = path.filename().string();
  const std::string stem = name.substr(0, name.find('.', 1));
  return stem.empty() ? "case" : stem;
}

std::vector<std::string> problems(const SimulateOptions& options) {
  RangeCheck check_range;
  check_range.append(problems(options.attenuation));
  check_range.append(problems(options.xray));
  check_range.append(problems(options.phantom_options));
  check_range.append(problems(options.stress));
  check_range.require("target_side_mm", options.target_side_mm, 1.0, 1000.0);
  check_range.require("max_offset_rotation_deg", options.max_offset_rotation_deg, 0.0, 60.0);
  check_range.require("max_offset_translation_mm", options.max_offset_translation_mm, 0.0, 1000.0);
  check_range.require("fiducial_sigma_px", options.fiducial_sigma_px, 0.0, 100.0);
  if (options.phantom_options.has_metal && options.phantom.empty())
    check_range.add("metal: needs a phantom; a CT has its own");
  for (const double value : options.center_ct_mm)
    if (!std::isfinite(value)) check_range.add("center_ct_mm must be finite");
  const std::vector<double>& box = options.target_box_ct_mm;
  for (std::size_t axis = 0; box.size() == 6 && axis < 3; ++axis)
    if (!(box[axis] < box[axis + 3]) || !std::isfinite(box[axis + 3] - box[axis]))
      check_range.add("target_box_ct_mm: low " + std::to_string(box[axis]) +
                      " must be below high " + std::to_string(box[axis + 3]));
  for (const int side : options.roi_px)
    if (side < 16) check_range.add("roi_px = " + std::to_string(side) + ": must be at least 16");
  if (options.case_name.find_first_of("/\\\"\n") != std::string::npos)
    check_range.add("case = " + options.case_name + ": must not hold / \\ \" or line ends");
  return check_range.problems();
}

void bind_options(CLI::App& app, SimulateOptions& options) {
  bind_input(app, options);
  bind_output(app, options);
  bind_target(app, options);
  bind_truth(app, options);
  bind_imaging(app, options);
  bind_stress(app, options);
}

}  // namespace af::tools
