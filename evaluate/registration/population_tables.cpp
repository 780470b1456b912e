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
                        population_success(patients, CountedEnd::Tre, counting),
                        population_success(patients, CountedEnd::Mrpd, counting),
                        joined(condition.commits, " ")};
  std::vector<double> tre_mm;
  std::vector<double> seconds;
  for (const PatientOutcomes* patient : patients) {
    for (const TreOutcome& outcome : patient->by_tre)
      if (outcome.tre_mm < counting.success_mm) tre_mm.push_back(outcome.tre_mm);
    for (const double value : patient->seconds)
      if (std::isfinite(value)) seconds.push_back(value);
  }
  group.median_tre_mm = summarize(tre_mm).median;
  group.median_seconds = summarize(seconds).median;
  return group;
}

/// What a row says of a group's success by one error.
CsvCells success_of(const PopulationSuccess& success, const std::string& error) {
  double worst = 1.0;
  double smallest_mm = std::numeric_limits<double>::infinity();
  for (const PatientSuccess& patient : success.patients) {
    worst = std::min(worst,
                     static_cast<double>(patient.successes) / static_cast<double>(patient.starts));
    smallest_mm = std::min(smallest_mm, patient.capture.initial_tre_mm);
  }
  const MeanOverCases& rate = success.rate;
  const MeanOverCases& own = success.capture_mm;
  CsvCells cells = {{error + "successes", success.successes},
                    {error + "rate", rate.value},
                    {error + "student_low", rate.student.low},
                    {error + "student_high", rate.student.high},
                    {error + "bootstrap_low", rate.bootstrap.low},
                    {error + "bootstrap_high", rate.bootstrap.high},
                    {error + "worst_patient_rate", worst},
                    {error + "capture_mm", success.pooled.initial_tre_mm},
                    {error + "capture_ended_by", to_string(success.pooled.end)},
                    {error + "capture_bootstrap_low_mm", success.pooled_interval_mm.low},
                    {error + "capture_bootstrap_high_mm", success.pooled_interval_mm.high},
                    {error + "patients_capture_mean_mm", own.value},
                    {error + "patients_capture_student_low_mm", own.student.low},
                    {error + "patients_capture_student_high_mm", own.student.high},
                    {error + "patients_capture_bootstrap_low_mm", own.bootstrap.low},
                    {error + "patients_capture_bootstrap_high_mm", own.bootstrap.high},
                    {error + "patients_capture_smallest_mm", smallest_mm},
                    {error + "patients_capture_lower_bounds", success.capture_lower_bounds},
                    {error + "patients_with_failures", success.patients_with_failures},
                    {error + "share_with_failures_low", success.share_with_failures.low},
                    {error + "share_with_failures_high", success.share_with_failures.high}};
  for (std::size_t i = 0; i < kLadderMm.size(); ++i)
    cells.emplace_back(error + "below_" + number_text(kLadderMm[i]) + "_mm",
                       success.below_ladder[i]);
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
                      {"patients", group.by_tre.patients.size()},
                      {"starts", group.by_tre.starts},
                      {"median_tre_mm", group.median_tre_mm},
                      {"median_seconds", group.median_seconds}};
    append(success_of(group.by_tre, "tre_"), cells);
    append(success_of(group.by_mrpd, "mrpd_"), cells);
    append({{"success_mm", success_mm}, {"commit", group.commits}}, cells);
    return cells;
  });
}

CsvTable patients_table(const std::vector<PopulationGroup>& groups) {
  std::vector<CsvCells> rows;
  for (const PopulationGroup& group : groups) {
    if (group.group != "all") continue;
    for (std::size_t i = 0; i < group.by_tre.patients.size(); ++i) {
      const PatientSuccess& tre = group.by_tre.patients[i];
      const PatientSuccess& mrpd = group.by_mrpd.patients[i];
      rows.push_back({{"condition", group.condition},
                      {"patient", tre.patient},
                      {"starts", tre.starts},
                      {"tre_successes", tre.successes},
                      {"wilson_low", tre.wilson.low},
                      {"wilson_high", tre.wilson.high},
                      {"capture_mm", tre.capture.initial_tre_mm},
                      {"capture_ended_by", to_string(tre.capture.end)},
                      {"mrpd_successes", mrpd.successes},
                      {"mrpd_capture_mm", mrpd.capture.initial_tre_mm},
                      {"mrpd_capture_ended_by", to_string(mrpd.capture.end)},
                      {"commit", group.commits}});
    }
  }
  return csv_table(std::move(rows));
}

CsvTable intervals_table(const std::vector<PopulationGroup>& groups) {
  std::vector<CsvCells> rows;
  for (const PopulationGroup& group : groups) {
    if (group.group != "all") continue;
    for (const auto& [error, success] :
         {std::pair("tre", &group.by_tre), std::pair("mrpd", &group.by_mrpd)})
      for (std::size_t k = 0; k < success->intervals.size(); ++k)
        rows.push_back({{"condition", group.condition},
                        {"error", error},
                        {"low_mm", success->intervals[k].low_mm},
                        {"high_mm", success->intervals[k].high_mm},
                        {"starts", success->intervals[k].trials},
                        {"successes", success->intervals[k].successes},
                        {"bootstrap_low", success->interval_bootstraps[k].low},
                        {"bootstrap_high", success->interval_bootstraps[k].high},
                        {"commit", group.commits}});
  }
  return csv_table(std::move(rows));
}

}  // namespace af::evaluation
