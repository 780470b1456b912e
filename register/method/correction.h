// SPDX-License-Identifier: Apache-2.0
// Corrected finish: registration by look-up ends at a pose slightly off ray casting's, because the
// field interpolates and quantises. From there the last stage converges by ray casting.
#pragma once

#include "base/described_fields.h"
#include "register/method/correction_report.h"

namespace af::registration {

struct CorrectionOptions {
  bool is_wanted = false;
  /// A step that is no longer, mean over the target box, is the last one.
  double tolerance_mm = 0.005;
  int max_casts = 50;  ///< ray-cast DRRs per view

  void describe(Fields& field);
};

/// Of options that ask for one where rays are cast anyway.
inline constexpr const char* kCorrectsRayCasting =
    "--correct = set: must not be given with --renderer raycast, whose DRRs are ray-cast already";

}  // namespace af::registration
