// SPDX-License-Identifier: Apache-2.0
#include "evaluate/simulate/stress.h"

#include <algorithm>
#include <array>
#include <sstream>

#include "evaluate/simulate/ct_degradation.h"
#include "evaluate/simulate/occluders.h"
#include "evaluate/simulate/smooth_motion.h"

namespace af {

namespace {

constexpr double kHeelRamp = 0.25;         // share of the beam lost or gained at the edges
constexpr double kScatterToPrimary = 2.0;  // including scatter from the open beam
constexpr double kPhotonsPerPixel = 2e4;   // in the open beam

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

/// Joins text and numbers. Numbers are as short as possible.
template <typename... Parts>
std::string sentence(const Parts&... parts) {
  std::ostringstream text;
  (text << ... << parts);
  return text.str();
}

std::string description(Stress effect, const StressOptions& o) {
  const OccluderOptions occluders;
  const CtDegradationOptions degraded;
  const SmoothMotionOptions motion;
  switch (effect) {
    case Stress::Rods:
      return sentence(occluders.rod_count,
                      " steel rods of ",
                      occluders.rod_diameter_mm,
                      " mm across the region of interest, in the X-rays but not in the CT");
    case Stress::Fiducials:
      return sentence(occluders.ball_count,
                      " steel balls of ",
                      occluders.ball_diameter_mm,
                      " mm in the region of interest, in the X-rays but not in the CT");
    case Stress::Heel:
      return sentence("the beam varies by +-",
                      100.0 * kHeelRamp,
                      " % from the first to the last row of the detector");
    case Stress::Scatter:
      return sentence("scatter that the open beam adds to, ",
                      kScatterToPrimary,
                      " times the primary within the region of interest");
    case Stress::Noise:
      return sentence("Poisson noise of ", kPhotonsPerPixel, " photons per pixel in the open beam");
    case Stress::DegradedCt:
      return sentence("the study's CT has slices of about ",
                      degraded.slice_mm,
                      " mm, noise of ",
                      degraded.noise_hu,
                      " HU and steps of ",
                      degraded.step_hu,
                      " HU; the X-rays show the original CT",
                      o.has(Stress::Motion) ? ", moved" : "");
    case Stress::Calibration:
      return sentence("the rig of the study misses the one of the X-rays by ",
                      kCalibrationErrorPx,
                      " px RMS over the target box");
    case Stress::Motion:
      return sentence("the X-rays show anatomy moved smoothly by up to ",
                      motion.amplitude_mm,
                      " mm along each axis, not at all within ",
                      motion.margin_mm,
                      " mm of the target box and fully beyond another ",
                      motion.ramp_mm,
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
  if (has(Stress::Heel)) detector.heel_ramp = kHeelRamp;
  if (has(Stress::Noise)) detector.photons_per_pixel = kPhotonsPerPixel;
  if (has(Stress::Scatter)) {
    detector.scatter_to_primary_ratio = kScatterToPrimary;
    detector.scatter_source = ScatterSource::ObjectAndOpenBeam;
  }
  return detector;
}

void StressOptions::describe(Fields& field) {
  field("stress",
        names,
        "What to add, comma separated: steel rods or fiducials, heel effect, heavy scatter, noise, "
        "a degraded CT, a slightly wrong calibration, non-rigid motion; or all")
      .comma_separated()
      .one_of(stress_names())
      .choice(stress_names());
}

std::vector<StressDescription> descriptions(const StressOptions& options) {
  std::vector<StressDescription> lines;
  for (const NamedStress& named : kNamedStresses)
    if (options.has(named.effect))
      lines.push_back({named.name, description(named.effect, options)});
  return lines;
}

}  // namespace af
