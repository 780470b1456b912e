// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>

#include "evaluate/registration/case_evaluation.h"

namespace af::evaluation {

/// Evaluates the poses that another program found for one case (--poses-from), from the starts of
/// --starts-from, as if they were registrations: same errors, same statistics. It needs neither
/// X-rays nor fields nor the CT. A start without a pose is a failure with the stop reason
/// "no-pose", and `pose_problems` names it. `on_starts` is called first, then the rows are added to
/// `rows`. For rank 0.
CaseEvaluation evaluate_found_poses(const RegistrationStudyOptions& options,
                                    const Study& study,
                                    const StudyCase& study_case,
                                    const std::function<void(const CaseEvaluation&)>& on_starts,
                                    std::vector<RegistrationRow>& rows);

}  // namespace af::evaluation
