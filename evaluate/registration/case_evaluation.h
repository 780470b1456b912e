// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "evaluate/registration/evaluate_registrations.h"
#include "evaluate/registration/failure_traces.h"
#include "evaluate/registration/loaded_methods.h"
#include "evaluate/registration/registration_rows.h"
#include "evaluate/registration/start_tables.h"
#include "evaluate/registration/yardstick.h"
#include "evaluate/starts/perturbed_starts.h"
#include "ranks/communicator.h"
#include "ranks/run_folder.h"
#include "register/verdict/registration.h"
#include "study/case_gold_standard.h"
#include "study/study_file.h"

namespace af::evaluation {

/// The results of one case of a study. Rank 0 has all of them, and the others have what their work
/// needs.
struct CaseEvaluation {
  std::string case_name;
  GoldStandard gold;
  /// On rank 0; the list of starts is on every rank until they are registered.
  StratifiedStarts starts;
  std::size_t start_count = 0;
  std::map<std::string, FirstTraces> traces;  ///< rank 0: by renderer
  LoadedInputs inputs;
  std::vector<std::string> pose_problems;             ///< about poses that were read, in words
  nlohmann::json pictures = nlohmann::json::array();  ///< rank 0: files and what they show
};

/// The frames of poses in files of one case.
PoseTableFrames pose_table_frames(const RegistrationStudyOptions& options,
                                  const Study& study,
                                  const StudyCase& study_case,
                                  const RigidTransform& gold_room_from_ct);

/// The frame of a case's starts.
StartFrame start_frame(const StudyCase& study_case, const Yardstick& yardstick);

/// The starts of --starts-from for one case. `notes` receives what the reader of the file says.
StratifiedStarts given_starts(const RegistrationStudyOptions& options,
                              const Study& study,
                              const StudyCase& study_case,
                              const Yardstick& yardstick,
                              StartMeasures& measures,
                              std::vector<std::string>& notes);

/// The start of a row.
void set_start(const PerturbedStart& start, RegistrationRow& row);

/// The row of one registration, without case and renderer. An exception of `run` is never passed
/// on: it becomes stop reason "error" with its message. A result without similarity has no pose.
/// \test RegisteredRow.OfARegistrationThatThrowsIsAFailure
RegistrationRow registered_row(
    const std::function<registration::RegistrationRecord(const RigidTransform& start)>& run,
    const PerturbedStart& start,
    const Yardstick& yardstick);

/// Collective. Draws a case's starts, and calls `on_starts` with the evaluation so far (on rank 0,
/// before anything is registered). Then registers from every start with every renderer, sharing the
/// work over ranks as they become free, and draws the X-rays and the overlays of the best, median
/// and worst result. A registration that throws becomes a row without a pose. With --starts-only
/// nothing is registered or drawn. Rank 0 adds the rows, by renderer and start index, to `rows`.
CaseEvaluation evaluate_case(const RegistrationStudyOptions& options,
                             const Study& study,
                             const StudyCase& study_case,
                             const RunFolder& run,
                             const std::shared_ptr<registration::KeptFields>& kept_fields,
                             const Communicator& world,
                             const std::function<void(const CaseEvaluation&)>& on_starts,
                             std::vector<RegistrationRow>& rows);

}  // namespace af::evaluation
