// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "evaluate/gold_standard_files.h"
#include "evaluate/perturbed_starts.h"
#include "evaluate/registration_command.h"
#include "evaluate/registration_rows_files.h"
#include "io/study_file.h"
#include "parallel/communicator.h"
#include "register/registration.h"

namespace af::evaluation {

/// What one case of a study gave.
struct CaseEvaluation {
  std::string case_name;
  GoldStandard gold;
  StratifiedStarts starts;
  std::vector<RegistrationRow> rows;  ///< rank 0: by renderer, start index
  std::map<std::string, std::string> input_sha256;
  nlohmann::json pictures = nlohmann::json::array();  ///< rank 0: files and what they show
};

/// What registrations are measured with.
struct Yardstick {
  PoseFrame gold_frame;
  RigidTransform gold_room_from_ct = RigidTransform::Identity();
  std::optional<RigidTransform> stated_pose;  ///< only beside fiducials
  std::vector<Eigen::Vector3d> points_ct_mm;
};

/// The row of one registration, without case, renderer and start index. Never throws for `run`: an
/// exception becomes stop reason "error" with its message; a result without similarity has no pose.
/// \test RegisteredRow.OfARegistrationThatThrowsIsAFailure
RegistrationRow registered_row(
    const std::function<registration::RegistrationResult(const RigidTransform& start)>& run,
    const PerturbedStart& start,
    const Yardstick& yardstick);

/// Collective. Draws a case's starts, calls `on_starts` with the evaluation so far (on every rank,
/// before anything is registered), registers from every start with every renderer, the work shared
/// over the ranks as these become free, and draws the X-rays and the overlays of the best, median
/// and worst result. A registration that throws becomes a row without a pose.
CaseEvaluation evaluate_case(const RegistrationStudyOptions& options,
                             const Study& study,
                             const StudyCase& study_case,
                             const Communicator& world,
                             const std::function<void(const CaseEvaluation&)>& on_starts);

}  // namespace af::evaluation
