// SPDX-License-Identifier: Apache-2.0
#include "evaluate/pose_results_program.h"

#include <cmath>

#include "evaluate/start_pose_files.h"

namespace af::evaluation {
namespace {

RegistrationRow found_row(const FoundPoses& found, std::int64_t index, const Yardstick& yardstick) {
  RegistrationRow row;
  row.seconds = RegistrationRow::kMissing;
  row.stop_reason = "no-pose";
  if (const auto seconds = found.seconds.find(index); seconds != found.seconds.end())
    row.seconds = seconds->second;
  if (const auto pose = found.room_from_ct.find(index); pose != found.room_from_ct.end()) {
    row.stop_reason = "pose-given";
    measure_pose(pose->second, yardstick, row);
  }
  return row;
}

}  // namespace

CaseEvaluation evaluate_found_poses(const RegistrationStudyOptions& options,
                                    const Study& study,
                                    const StudyCase& study_case,
                                    const std::function<void(const CaseEvaluation&)>& on_starts) {
  CaseEvaluation evaluation;
  evaluation.case_name = study_case.name;
  evaluation.gold = gold_standard(study, study_case, options.gold);
  evaluation.starts = given_starts(options, study, study_case, evaluation.gold);
  on_starts(evaluation);
  const Yardstick yardstick = yardstick_of(study, study_case, evaluation.gold);
  const FoundPoses found =
      read_found_poses(options.poses_from, pose_table_frames(study, study_case, evaluation.gold));
  evaluation.pose_problems = found.problems;
  const auto count = static_cast<std::int64_t>(evaluation.starts.starts.size());
  for (std::int64_t index = 0; index < count; ++index) {
    RegistrationRow row = found_row(found, index, yardstick);
    set_start(evaluation.starts.starts[static_cast<std::size_t>(index)], row);
    row.case_name = study_case.name;
    row.renderer = options.method_name;
    row.start_index = index;
    if (!found.room_from_ct.contains(index))
      evaluation.pose_problems.push_back(study_case.name + ": no pose for start " +
                                         std::to_string(index));
    evaluation.rows.push_back(row);
  }
  for (const auto& [index, pose] : found.room_from_ct)
    if (index < 0 || index >= count)
      evaluation.pose_problems.push_back(study_case.name + ": a pose for start " +
                                         std::to_string(index) + ", which does not exist");
  return evaluation;
}

}  // namespace af::evaluation
