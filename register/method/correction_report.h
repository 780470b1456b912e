// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <limits>
#include <tuple>

namespace af::registration {

/// What a correction did; NaN: there was none.
struct CorrectionReport {
  static constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

  int casts = 0;                 ///< DRRs per view; 0: the search before had not converged
  double moved_mm = kNone;       ///< end from the end of look-up, mean over the target box
  double last_mm = kNone;        ///< likewise, by the last cast alone
  double defect_rms = kNone;     ///< of the last ray-cast DRRs less looked-up ones, all views
  double defect_change = kNone;  ///< rms of the last defect less the one before, over defect_rms
  bool stood_still = false;      ///< last_mm is within the tolerance

  auto members() {
    return std::tie(casts, moved_mm, last_mm, defect_rms, defect_change, stood_still);
  }
};

}  // namespace af::registration
