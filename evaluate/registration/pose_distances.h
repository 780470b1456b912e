// SPDX-License-Identifier: Apache-2.0
// Distances between the end poses of two methods from the same starts. A difference of two TREs
// lets errors in opposite directions cancel; a distance does not.
#pragma once

#include <string>
#include <vector>

#include "base/sample_summary.h"
#include "evaluate/report/evaluation_run.h"
#include "text/csv_table.h"

namespace af::evaluation {

/// Two methods on one case.
struct PoseDistanceRow {
  std::string case_name;
  std::string run_a, renderer_a;  ///< a run's folder's name
  std::string run_b, renderer_b;
  SampleSummary distance_mm;  ///< mean over the target box, of starts where both have an end pose
};

/// Every two methods of the runs that began at the same starts: rows of one case whose start index
/// is equal, and whose start is up to rounding. FileError when a run does not state its cases' gold
/// pose and target box.
std::vector<PoseDistanceRow> pose_distances(const std::vector<EvaluationRun>& runs);

CsvTable pose_distances_table(const std::vector<PoseDistanceRow>& rows);

/// The same for people, as a table in Markdown.
std::string pose_distances_markdown(const std::vector<PoseDistanceRow>& rows);

}  // namespace af::evaluation
