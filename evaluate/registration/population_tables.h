// SPDX-License-Identifier: Apache-2.0
// The tables of a study of many patients.
#pragma once

#include <string>
#include <vector>

#include "evaluate/registration/population_runs.h"
#include "evaluate/registration/population_statistics.h"
#include "files/csv_table.h"

namespace af::evaluation {

/// Some of a condition's patients.
struct PopulationGroup {
  std::string condition;
  std::string group;  ///< "all", "odd", "even", "real", or a kind of patient
  std::string error;  ///< that counts ends: "TRE", "mRPD", or both
  PopulationSuccess success;
  std::string commits;            ///< of the programs that made the condition's runs
  double median_error_mm = kNan;  ///< of successes
  double median_depth_mm = kNan;  ///< of successes of one view
  double p95_depth_mm = kNan;     ///< the same
  double median_seconds = kNan;
};

/// All patients of the condition, then the halves, then the kinds.
std::vector<PopulationGroup> groups_of(const PopulationCondition& condition,
                                       const PopulationCounting& counting);

/// population.csv: a row per condition and group. Ends below `success_mm` count as successes.
CsvTable population_table(const std::vector<PopulationGroup>& groups, double success_mm);
/// patients.csv: a row per condition and patient.
CsvTable patients_table(const std::vector<PopulationGroup>& groups);
/// intervals.csv: a row per condition and interval of initial TRE.
CsvTable intervals_table(const std::vector<PopulationGroup>& groups);

}  // namespace af::evaluation
