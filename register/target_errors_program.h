// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "io/study_file.h"
#include "register/result_files.h"

namespace af::registration {

/// Fills in every record's TRE (mean over the target box) when
/// the study knows the case's gold pose: from its fiducials if it has any, else the one it states.
void add_target_errors(const Study& study,
                       const StudyCase& study_case,
                       std::vector<RegistrationRecord>& records);

}  // namespace af::registration
