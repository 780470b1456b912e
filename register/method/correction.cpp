// SPDX-License-Identifier: Apache-2.0
#include "register/method/correction.h"

namespace af::registration {

void CorrectionOptions::describe(Fields& field) {
  field.start_group("Method");
  field(
      "correct",
      is_wanted,
      "Correct the final pose by ray casting: from where look-up ends, the last stage converges "
      "once "
      "more, with DRRs that are cast through the CT. Look-up gives the measure's curvature there, "
      "so 3 to 10 ray-cast DRRs per view are enough: a tenth of a second, or a few. Stages whose "
      "optimiser uses no derivatives (best-neighbor, as in paper) search at their final step: 13 "
      "casts or more. Needs the CT");
  field("correct_tolerance_mm",
        tolerance_mm,
        "With --correct: stop after a step that moves the pose by no more than this, mean over the "
        "target box, mm; optimisers without derivatives end at their final step")
      .above(0.0)
      .finite();
  field("correct_max_casts", max_casts, "With --correct: most casts per view").within(1, 1000);
  field("correct_step_mm",
        step_mm,
        "With --correct: longest step along its rays, mm, even where --step-mm is "
        "longer: with a single view, the position along the beam depends on it")
      .above(0.0)
      .finite();
  field.start_group("");
}

}  // namespace af::registration
