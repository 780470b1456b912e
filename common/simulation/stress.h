// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "base/described_fields.h"
#include "simulation/calibration_error.h"
#include "simulation/ct_degradation.h"
#include "simulation/detector_model.h"
#include "simulation/occluders.h"
#include "simulation/smooth_motion.h"

namespace af {

/// What real X-rays have and a clean simulation lacks.
enum class Stress { Rods, Fiducials, Heel, Scatter, Noise, DegradedCt, Calibration, Motion };

/// "all" and the name of every effect, as typed.
std::vector<std::string> stress_names();

/// Which effects are wanted and how strong they are. Strengths count only where the effect is
/// wanted.
struct StressOptions {
  std::vector<std::string> names;  ///< of stress_names()
  OccluderOptions occluders;
  double heel_ramp = 0.25;                ///< share of the beam lost or gained at the edges
  double scatter_to_primary_ratio = 2.0;  ///< of scatter that the open beam adds to
  double photons_per_pixel = 2e4;         ///< in the open beam
  CtDegradationOptions degraded_ct;
  double calibration_error_px = 0.2;  ///< RMS over the target box
  SmoothMotionOptions motion;

  [[nodiscard]] bool has(Stress effect) const;
  /// The detector with the wanted ones of ramp, scatter and noise.
  [[nodiscard]] DetectorOptions detector(DetectorOptions detector) const;

  void describe(Fields& field);
};

std::vector<std::string> problems(const StressOptions& options);

/// One effect that was simulated, in words with numbers and units.
struct StressDescription {
  std::string name;
  std::string text;
};

/// The wanted effects in the order of Stress.
std::vector<StressDescription> descriptions(const StressOptions& options);

}  // namespace af
