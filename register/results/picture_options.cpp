// SPDX-License-Identifier: Apache-2.0
#include "register/results/picture_options.h"

namespace af::registration {

void PictureOptions::describe(Fields& field) {
  field("no_pictures",
        are_left_out,
        "Write neither pictures nor folders for 3D Slicer, for batches of many runs")
      .not_deciding("registrations are the same");
}

}  // namespace af::registration
