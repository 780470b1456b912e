// SPDX-License-Identifier: Apache-2.0
#include "evaluate/registration/population_tables.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

#include "base/joined.h"
#include "base/sample_summary.h"
#include "files/csv_cells.h"

namespace af::evaluation {

namespace {

PopulationGroup group_of(const PopulationCondition& condition,
                         const std::string& name,
                         const std::vector<const PatientOutcomes*>& patients,
                         const PopulationCounting& counting) {
  PopulationGroup group{condition.name,
                        name,
                        joined(condition.errors, " or "),
                        population_success(patients, counting),
                        joined(condition.commits, " ")};
  std::vector<double> error_mm;
  std::vector<double> depth_mm;
  std::vector<double> seconds;
  for (const PatientOutcomes* patient : patients) {
    for (const TreOutcome& outcome : patient->outcomes)
      if (outcome.error_mm < counting.success_mm) error_mm.push_back(outcome.error_mm);
    depth_mm.insert(depth_mm.end(), patient->depth_mm.begin(), patient->depth_mm.end());
    for (const double value : patient->seconds)
      if (std::isfinite(value)) seconds.push_back(value);
  }
  group.median_error_mm = summarize(error_mm).median;
  const SampleSummary depth = summarize(depth_mm);
  group.median_depth_mm = depth.median;
  group.p95_depth_mm = depth.percentile_95;
  group.median_seconds = summarize(seconds).median;
  return group;
}

CsvCells success_of(const PopulationSuccess& success) {
  double worst = 1.0;
  double smallest_mm = std::numeric_limits<double>::infinity();
  for (const PatientSuccess& patient : success.patients) {
    worst = std::min(worst,
                     static_cast<double>(patient.successes) / static_cast<double>(patient.starts));
    smallest_mm = std::min(smallest_mm, patient.capture.initial_tre_mm);
  }
  const MeanOverCases& rate = success.rate;
  const MeanOverCases& own = success.capture_mm;
  CsvCells cells = {{"successes", success.successes},
                    {"rate", rate.value},
                    {"student_low", rate.student.low},
                    {"student_high", rate.student.high},
                    {"bootstrap_low", rate.bootstrap.low},
                    {"bootstrap_high", rate.bootstrap.high},
                    {"worst_patient_rate", worst},
                    {"capture_mm", success.pooled.initial_tre_mm},
                    {"capture_ended_by", to_string(success.pooled.end)},
                    {"capture_bootstrap_low_mm", success.pooled_interval_mm.low},
                    {"capture_bootstrap_high_mm", success.pooled_interval_mm.high},
                    {"patients_capture_mean_mm", own.value},
                    {"patients_capture_student_low_mm", own.student.low},
                    {"patients_capture_student_high_mm", own.student.high},
                    {"patients_capture_bootstrap_low_mm", own.bootstrap.low},
                    {"patients_capture_bootstrap_high_mm", own.bootstrap.high},
                    {"patients_capture_smallest_mm", smallest_mm},
                    {"patients_capture_lower_bounds", success.capture_lower_bounds},
                    {"patients_with_failures", success.patients_with_failures},
                    {"share_with_failures_low", success.share_with_failures.low},
                    {"share_with_failures_high", success.share_with_failures.high}};
  for (std::size_t i = 0; i < kLadderMm.size(); ++i)
    cells.emplace_back("below_" + number_text(kLadderMm[i]) + "_mm", success.below_ladder[i]);
  return cells;
}

}  // namespace

/// All patients, the two halves, and the kinds.
std::vector<PopulationGroup> groups_of(const PopulationCondition& condition,
                                       const PopulationCounting& counting) {
  std::vector<std::string> names{"all"};
  std::map<std::string, std::vector<const PatientOutcomes*>> members;
  const auto add = [&](const std::string& name, const PatientOutcomes& patient) {
    std::vector<const PatientOutcomes*>& list = members[name];
    if (list.empty() && name != "all") names.push_back(name);
    list.push_back(&patient);
  };
  for (const PatientOutcomes& patient : condition.patients) add("all", patient);
  for (const PatientOutcomes& patient : condition.patients) add(half_of(patient), patient);
  for (const PatientOutcomes& patient : condition.patients)
    if (patient.number() > 0) add(patient.kind(), patient);
  std::vector<PopulationGroup> groups;
  groups.reserve(names.size());
  for (const std::string& name : names)
    groups.push_back(group_of(condition, name, members[name], counting));
  return groups;
}

CsvTable population_table(const std::vector<PopulationGroup>& groups, double success_mm) {
  return csv_table(groups, [&](const PopulationGroup& group) {
    CsvCells cells = {{"condition", group.condition},
                      {"group", group.group},
                      {"patients", group.success.patients.size()},
                      {"starts", group.success.starts},
                      {"error", group.error},
                      {"median_error_mm", group.median_error_mm},
                      {"median_depth_mm", group.median_depth_mm},
                      {"p95_depth_mm", group.p95_depth_mm},
                      {"median_seconds", group.median_seconds}};
    append(success_of(group.success), cells);
    append({{"success_mm", success_mm}, {"commit", group.commits}}, cells);
    return cells;
  });
}

CsvTable patients_table(const std::vector<PopulationGroup>& groups) {
  std::vector<CsvCells> rows;
  for (const PopulationGroup& group : groups) {
    if (group.group != "all") continue;
    for (const PatientSuccess& patient : group.success.patients)
      rows.push_back({{"condition", group.condition},
                      {"patient", patient.patient},
                      {"starts", patient.starts},
                      {"error", group.error},
                      {"successes", patient.successes},
                      {"wilson_low", patient.wilson.low},
                      {"wilson_high", patient.wilson.high},
                      {"capture_mm", patient.capture.initial_tre_mm},
                      {"capture_ended_by", to_string(patient.capture.end)},
                      {"commit", group.commits}});
  }
  return csv_table(std::move(rows));
}

CsvTable intervals_table(const std::vector<PopulationGroup>& groups) {
  std::vector<CsvCells> rows;
  for (const PopulationGroup& group : groups) {
    if (group.group != "all") continue;
    const std::vector<IntervalSuccess>& intervals = group.success.intervals;
    for (std::size_t k = 0; k < intervals.size(); ++k)
      rows.push_back({{"condition", group.condition},
                      {"error", group.error},
                      {"low_mm", intervals[k].low_mm},
                      {"high_mm", intervals[k].high_mm},
                      {"starts", intervals[k].trials},
                      {"successes", intervals[k].successes},
                      {"bootstrap_low", group.success.interval_bootstraps[k].low},
                      {"bootstrap_high", group.success.interval_bootstraps[k].high},
                      {"commit", group.commits}});
  }
  return csv_table(std::move(rows));
}

}  // namespace af::evaluation
