// SPDX-License-Identifier: Apache-2.0
// Distances between the end poses of two methods from the same starts. In a difference of two TREs,
// errors in opposite directions cancel; in a distance they do not.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "base/sample_summary.h"
#include "evaluate/report/evaluation_run.h"
#include "evaluate/statistics/case_equivalence.h"
#include "files/csv_table.h"

namespace af::evaluation {

/// Two methods on one case.
struct PoseDistanceRow {
  std::string case_name;
  std::string run_a, renderer_a;  ///< name of a run's folder
  std::string run_b, renderer_b;
  SampleSummary distance_mm;   ///< mean over the target box, for starts where both have an end pose
  SampleSummary rotation_deg;  ///< of one end relative to the other (geodesic), for the same starts
};

/// Every pair of methods of the runs that began at the same starts: rows of one case with equal
/// start index and, up to rounding, equal start. Throws InputError when two such were found in
/// different X-rays, as far as their runs state these, and FileError as facts_of() and read_rows()
/// do.
std::vector<PoseDistanceRow> pose_distances(const std::vector<EvaluationRun>& runs);

CsvTable pose_distances_table(const std::vector<PoseDistanceRow>& rows);

/// Two methods over all patients that both registered.
struct PatientDistances {
  std::string run_a, renderer_a;
  std::string run_b, renderer_b;
  std::size_t starts = 0;
  CaseEquivalence equivalence;  ///< of the patients' mean distances
};

/// In the order of the rows. Every patient counts the same, whatever the number of poses
/// (patient_of_case()).
std::vector<PatientDistances> distances_over_patients(const std::vector<PoseDistanceRow>& rows,
                                                      double margin_mm);

CsvTable patient_distances_table(const std::vector<PatientDistances>& methods);

}  // namespace af::evaluation
