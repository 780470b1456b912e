// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "register/results/registration_results.h"
#include "study/case_gold_standard.h"
#include "study/study_file.h"

namespace af::registration {

/// Fills in every record's TRE: the mean over the target box.
void add_target_errors(const std::optional<GoldStandard>& gold,
                       const CtBox& target_box_ct,
                       std::vector<RegistrationRecord>& records);

}  // namespace af::registration
