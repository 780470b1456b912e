// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "base/described_fields.h"
#include "evaluate/simulate/detector_model.h"

namespace af {

/// What real X-rays have and a clean simulation lacks.
enum class Stress { Rods, Fiducials, Heel, Scatter, Noise, DegradedCt, Calibration, Motion };

/// "all" and the name of every effect, as typed.
std::vector<std::string> stress_names();

/// RMS over the target box.
inline constexpr double kCalibrationErrorPx = 0.2;

/// The requested effects. Their strengths are the defaults of what makes them.
struct StressOptions {
  std::vector<std::string> names;  ///< from stress_names()

  [[nodiscard]] bool has(Stress effect) const;
  /// The detector with the requested ones of ramp, scatter and noise.
  [[nodiscard]] DetectorOptions detector(DetectorOptions detector) const;

  void describe(Fields& field);
};

/// One effect that was simulated, in words with numbers and units.
struct StressDescription {
  std::string name;
  std::string text;
};

/// The requested effects in the order of Stress.
std::vector<StressDescription> descriptions(const StressOptions& options);

}  // namespace af
