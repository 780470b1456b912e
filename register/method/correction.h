// SPDX-License-Identifier: Apache-2.0
// Corrected finish. Registration by look-up ends at a pose slightly off ray casting's, because the
// field interpolates and quantises. From there the last stage converges by ray casting.
#pragma once

#include <algorithm>
#include <limits>
#include <tuple>

#include "base/described_fields.h"

namespace af::registration {

/// What a correction did. Distances are NaN when the end was left as it was: nothing was cast, or
/// the pose that casting found was discarded, because it is inadmissible or has no value.
struct CorrectionReport {
  static constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

  int casts = 0;  ///< DRRs per view; 0: the search had not converged, or no evaluation was left
  double moved_mm = kNone;  ///< from the end of look-up to the end, mean over the target box
  double last_mm = kNone;   ///< likewise, by the last step alone
  bool stood_still =
      false;  ///< the last step was within the tolerance, or within the search's final step

  auto members() { return std::tie(casts, moved_mm, last_mm, stood_still); }
};

struct CorrectionOptions {
  bool is_wanted = false;
  /// The correction stops after a step no longer than this, averaged over the target box.
  double tolerance_mm = 0.005;
  int max_casts = 50;    ///< ray-cast DRRs per view
  double step_mm = 0.5;  ///< longest step of its ray casting

  /// The step of ray casting where `wanted_mm` is asked for. A correction may need a shorter one.
  [[nodiscard]] double cast_step_mm(double wanted_mm) const {
    return is_wanted ? std::min(wanted_mm, step_mm) : wanted_mm;
  }
  void describe(Fields& field);
};

}  // namespace af::registration
