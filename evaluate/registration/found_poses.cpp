// SPDX-License-Identifier: Apache-2.0
#include "evaluate/registration/found_poses.h"

#include <filesystem>

#include "evaluate/registration/start_tables.h"
#include "files/sha256.h"

namespace af::evaluation {
namespace {

RegistrationRow found_row(const FoundPoses& found, std::int64_t index, const Yardstick& yardstick) {
  RegistrationRow row;
  row.has_one_view = yardstick.has_one_view();
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

/// "no pose for start 0", "no pose for starts 7 to 19": one line for each gap.
std::vector<std::string> missing_pose_problems(const std::string& case_name,
                                               const FoundPoses& found,
                                               std::int64_t count) {
  std::vector<std::string> problems;
  for (std::int64_t first = 0; first < count; ++first) {
    if (found.room_from_ct.contains(first)) continue;
    std::int64_t last = first;
    while (last + 1 < count && !found.room_from_ct.contains(last + 1)) ++last;
    problems.push_back(case_name + ": no pose for start" +
                       (first == last
                            ? " " + std::to_string(first)
                            : "s " + std::to_string(first) + " to " + std::to_string(last)));
    first = last;
  }
  return problems;
}

}  // namespace

CaseEvaluation evaluate_found_poses(const RegistrationStudyOptions& options,
                                    const Study& study,
                                    const StudyCase& study_case,
                                    const std::function<void(const CaseEvaluation&)>& on_starts,
                                    std::vector<RegistrationRow>& rows) {
  CaseEvaluation evaluation;
  evaluation.case_name = study_case.name;
  // The X-rays need not exist, because nothing reads them.
  for (const StudyView& view : study_case.views)
    if (std::filesystem::is_regular_file(view.xray))
      evaluation.inputs.identities[study_case.name + ": xray " + view.camera] =
          sha256_of_file(view.xray.string());
  evaluation.gold = gold_standard(study, study_case, options.gold);
  const Yardstick yardstick = yardstick_of(study, study_case, evaluation.gold);
  StartMeasures measures(start_frame(study_case, yardstick),
                         options.start_options(),
                         yardstick.points_ct_mm,
                         [](const RigidTransform&) { return true; });
  evaluation.starts =
      given_starts(options, study, study_case, yardstick, measures, evaluation.pose_problems);
  on_starts(evaluation);
  const FoundPoses found =
      read_found_poses(options.poses_from,
                       pose_table_frames(options, study, study_case, yardstick.gold_room_from_ct));
  evaluation.pose_problems.insert(
      evaluation.pose_problems.end(), found.problems.begin(), found.problems.end());
  evaluation.start_count = evaluation.starts.starts.size();
  const auto count = static_cast<std::int64_t>(evaluation.start_count);
  for (std::int64_t index = 0; index < count; ++index) {
    RegistrationRow row = found_row(found, index, yardstick);
    set_start(evaluation.starts.starts[static_cast<std::size_t>(index)], row);
    row.case_name = study_case.name;
    row.renderer = options.method_name;
    row.start_index = index;
    rows.push_back(std::move(row));
  }
  for (const std::string& text : missing_pose_problems(study_case.name, found, count))
    evaluation.pose_problems.push_back(text);
  for (const auto& [index, pose] : found.room_from_ct)
    if (index < 0 || index >= count)
      evaluation.pose_problems.push_back(study_case.name + ": a pose for start " +
                                         std::to_string(index) + ", which does not exist");
  return evaluation;
}

}  // namespace af::evaluation
