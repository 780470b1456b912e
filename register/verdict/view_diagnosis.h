// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "register/method/registration_result.h"
#include "register/problem/registration_problem.h"
#include "register/verdict/verdict.h"

namespace af::registration {

/// What looks wrong with the X-rays of a result.
struct ViewDiagnosis {
  std::vector<std::string> messages;  ///< one for each thing found, for people; empty: nothing
};

/// Looks at the values that PoseExaminer gave the views at `room_from_ct`. Where one of them is
/// low, the X-rays are tried inverted, mirrored left-right and up-down, turned by 180 degrees and
/// exchanged, one change at a time, each with a coarse registration from the start and from the
/// end. Reports a change that would explain far more; values within silhouettes are not compared.
/// Always reports views with the same X-ray. Nothing of `problem` changes.
/// \test ViewDiagnosis.NamesTheViewAndWhatWouldMendIt
ViewDiagnosis diagnose_views(const std::shared_ptr<const RegistrationProblem>& problem,
                             const RigidTransform& start_room_from_ct,
                             const RigidTransform& room_from_ct,
                             const std::vector<ViewValue>& view_values);

/// The judgement of a registration in the light of a diagnosis of its views: at least doubtful
/// where that found something. Its reason also tells of a clipped start.
Judgement judgement_of(const RegistrationResult& result,
                       std::span<const ViewValue> view_values,
                       const ViewDiagnosis& diagnosis);

}  // namespace af::registration
