// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>

#include "attenuation_fields/renderer.h"
#include "drr/opened_field.h"

namespace attenuation_fields {

struct Field::Facts {
  std::shared_ptr<const af::OpenedField> opened;  ///< read under a ReadingTurn
  std::string look_up;
  int members = 1;
  double max_rotation_deg = 0.0;
  double max_translation_mm = 0.0;
  af::CtIdentity ct;
  std::string payload_sha256;
  double water_mu_per_mm = 0.0;
};

}  // namespace attenuation_fields
