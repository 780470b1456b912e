// SPDX-License-Identifier: Apache-2.0
#include "register/method/correction.h"

namespace af::registration {

void CorrectionOptions::describe(Fields& field) {
  field.start_group("Method");
  field("correct",
        is_wanted,
        "Repeat the last stage with DRRs cast through the CT, from where look-up ends: 3 to 10 "
        "casts per view, 13 or more with best-neighbor");
  field(
      "correct_tolerance_mm",
      tolerance_mm,
      "With --correct: stop after a step that moves the target by no more than this on average, mm")
      .above(0.0)
      .finite();
  field("correct_max_casts", max_casts, "With --correct: most casts per view").within(1, 1000);
  field("correct_step_mm",
        step_mm,
        "With --correct: longest step along its rays, mm, which decides the depth of a single view")
      .above(0.0)
      .finite();
  field.start_group("");
}

}  // namespace af::registration
