// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "evaluate/starts/perturbed_starts.h"

namespace af::test {

/// The start frame of a case whose gold pose is turned and shifted. It turns about a point that is
/// not the target box's centre.
inline evaluation::StartFrame example_start_frame() {
  evaluation::StartFrame frame;
  frame.case_name = "skull-01";
  frame.gold_room_from_ct =
      pose_from_parameters(PoseFrame{}, PoseParameters::from_deg_and_mm({5, -8, 12, 30, -20, 10}));
  frame.center_ct_mm = {10, 20, -30};
  frame.target_box_ct = {{-20, -10, -60}, {40, 50, 0}};
  return frame;
}

}  // namespace af::test
