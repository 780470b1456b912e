// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "base/described_fields.h"

namespace af::registration {

/// What af-register and af-evaluate draw beside their tables.
struct PictureOptions {
  bool are_left_out = false;  ///< neither pictures nor folders for Slicer

  void describe(Fields& field);
};

}  // namespace af::registration
