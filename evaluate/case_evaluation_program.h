// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "evaluate/gold_standard_files.h"
#include "evaluate/perturbed_starts.h"
#include "evaluate/registration_command.h"
#include "evaluate/registration_rows_files.h"
#include "io/study_file.h"
#include "parallel/communicator.h"

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
