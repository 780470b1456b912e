// SPDX-License-Identifier: Apache-2.0
#include "simulation/stress.h"

#include <algorithm>
#include <array>
#include <sstream>

namespace af {

namespace {

struct NamedStress {
  Stress effect;
  const char* name;
};

constexpr std::array<NamedStress, 8> kNamedStresses = {{{Stress::Rods, "rods"},
                                                        {Stress::Fiducials, "fiducials"},
                                                        {Stress::Heel, "heel"},
                                                        {Stress::Scatter, "scatter"},
                                                        {Stress::Noise, "noise"},
                                                        {Stress::DegradedCt, "degraded-ct"},
                                                        {Stress::Calibration, "calibration"},
                                                        {Stress::Motion, "motion"}}};

const char* name_of(Stress effect) {
  return std::find_if(kNamedStresses.begin(),
                      kNamedStresses.end(),
                      [effect](const NamedStress& named) { return named.effect == effect; })
      ->name;
}

/// Joins text and numbers, numbers as short as they are.
template <typename... Parts>
std::string sentence(const Parts&... parts) {
  std::ostringstream text;
  (text << ... << parts);
  return text.str();
}

std::string description(Stress effect, const StressOptions& o) {
  switch (effect) {
    case Stress::Rods:
      return sentence(o.occluders.rod_count,
                      " steel rods of ",
                      o.occluders.rod_diameter_mm,
                      " mm across the region of interest, in the X-rays but not in the CT");
    case Stress::Fiducials:
      return sentence(o.occluders.ball_count,
                      " steel balls of ",
                      o.occluders.ball_diameter_mm,
                      " mm in the region of interest, in the X-rays but not in the CT");
    case Stress::Heel:
      return sentence("the beam varies by +-",
                      100.0 * o.heel_ramp,
                      " % from the first to the last row of the detector");
    case Stress::Scatter:
      return sentence("scatter that the open beam adds to, ",
                      o.scatter_to_primary_ratio,
                      " times the primary within the region of interest");
    case Stress::Noise:
      return sentence(
          "Poisson noise of ", o.photons_per_pixel, " photons per pixel in the open beam");
    case Stress::DegradedCt:
      return sentence("the study's CT has slices of about ",
                      o.degraded_ct.slice_mm,
                      " mm, noise of ",
                      o.degraded_ct.noise_hu,
                      " HU and steps of ",
                      o.degraded_ct.step_hu,
                      " HU; the X-rays show the original CT",
                      o.has(Stress::Motion) ? ", moved" : "");
    case Stress::Calibration:
      return sentence("the rig of the study misses the one of the X-rays by ",
                      o.calibration_error_px,
                      " px RMS over the target box");
    case Stress::Motion:
      return sentence("the X-rays show anatomy moved smoothly by up to ",
                      o.motion.amplitude_mm,
                      " mm along each axis, not at all within ",
                      o.motion.margin_mm,
                      " mm of the target box and fully beyond another ",
                      o.motion.ramp_mm,
                      " mm");
  }
  return {};
}

}  // namespace

std::vector<std::string> stress_names() {
  std::vector<std::string> names{"all"};
  for (const NamedStress& named : kNamedStresses) names.emplace_back(named.name);
  return names;
}

bool StressOptions::has(Stress effect) const {
  const std::string wanted = name_of(effect);
  return std::any_of(names.begin(), names.end(), [&](const std::string& name) {
    return name == wanted || name == "all";
  });
}

DetectorOptions StressOptions::detector(DetectorOptions detector) const {
  if (has(Stress::Heel)) detector.heel_ramp = heel_ramp;
  if (has(Stress::Noise)) detector.photons_per_pixel = photons_per_pixel;
  if (has(Stress::Scatter)) {
    detector.scatter_to_primary_ratio = scatter_to_primary_ratio;
    detector.scatter_source = ScatterSource::ObjectAndOpenBeam;
  }
  return detector;
}

void StressOptions::describe(Fields& field) {
  field("stress",
        names,
        "Comma separated: rods, fiducials (steel in the X-rays, not in the CT), heel (ramp over "
        "the detector), scatter (heavy, from the open beam too), noise, degraded-ct (the study's "
        "CT; X-rays show the good one), calibration (the study's rig is slightly wrong), motion "
        "(non-rigid, away from the target); or all")
      .comma_separated()
      .one_of(stress_names())
      .choice(stress_names());
  field.part(occluders);
  field("heel_ramp", heel_ramp, "heel: share by which the beam varies, 0.25 for +-25 %");
  field("open_scatter_to_primary",
        scatter_to_primary_ratio,
        "scatter: mean scatter / mean primary within the region of interest");
  field("noisy_photons_per_pixel", photons_per_pixel, "noise: photons per pixel in the open beam");
  field.part(degraded_ct);
  field("calibration_error_px",
        calibration_error_px,
        "calibration: RMS shift of the target box's projections, px")
      .within(1e-6, 20.0);
  field.part(motion);
}

std::vector<std::string> problems(const StressOptions& options) {
  std::vector<std::string> found = field_problems(options);
  if (found.empty()) found = problems(options.motion);
  // Strengths of detector effects keep the detector's limits, wanted or not.
  StressOptions all = options;
  all.names = {"all"};
  for (const std::string& text : problems(all.detector({}))) found.push_back(text);
  return found;
}

std::vector<StressDescription> descriptions(const StressOptions& options) {
  std::vector<StressDescription> lines;
  for (const NamedStress& named : kNamedStresses)
    if (options.has(named.effect))
      lines.push_back({named.name, description(named.effect, options)});
  return lines;
}

}  // namespace af
