// SPDX-License-Identifier: Apache-2.0
#include "evaluate/population/population_tables.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

#include "base/joined.h"
#include "base/number_text.h"
#include "base/sample_summary.h"

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

struct NamedCell {
  std::string name;
  std::string text;
};

/// What a row says of a group's success, in the order of its columns.
std::vector<NamedCell> success_of(const PopulationSuccess& success) {
  double worst = 1.0;
  double smallest_mm = std::numeric_limits<double>::infinity();
  for (const PatientSuccess& patient : success.patients) {
    worst = std::min(worst,
                     static_cast<double>(patient.successes) / static_cast<double>(patient.starts));
    smallest_mm = std::min(smallest_mm, patient.capture.initial_tre_mm);
  }
  const auto number = [](double value) { return number_text(value); };
  const auto& rate = success.rate;
  const auto& own = success.capture_mm;
  std::vector<NamedCell> cells = {
      {"successes", std::to_string(success.successes)},
      {"rate", number(rate.value)},
      {"student_low", number(rate.student.low)},
      {"student_high", number(rate.student.high)},
      {"bootstrap_low", number(rate.bootstrap.low)},
      {"bootstrap_high", number(rate.bootstrap.high)},
      {"worst_patient_rate", number(worst)},
      {"capture_mm", number(success.pooled.initial_tre_mm)},
      {"capture_ended_by", to_string(success.pooled.end)},
      {"capture_bootstrap_low_mm", number(success.pooled_interval_mm.low)},
      {"capture_bootstrap_high_mm", number(success.pooled_interval_mm.high)},
      {"patients_capture_mean_mm", number(own.value)},
      {"patients_capture_student_low_mm", number(own.student.low)},
      {"patients_capture_student_high_mm", number(own.student.high)},
      {"patients_capture_bootstrap_low_mm", number(own.bootstrap.low)},
      {"patients_capture_bootstrap_high_mm", number(own.bootstrap.high)},
      {"patients_capture_smallest_mm", number(smallest_mm)},
      {"patients_capture_lower_bounds", std::to_string(success.capture_lower_bounds)},
      {"patients_with_failures", std::to_string(success.patients_with_failures)},
      {"share_with_failures_low", number(success.share_with_failures.low)},
      {"share_with_failures_high", number(success.share_with_failures.high)}};
  for (std::size_t i = 0; i < kLadderMm.size(); ++i)
    cells.push_back(
        {"below_" + number_text(kLadderMm[i]) + "_mm", std::to_string(success.below_ladder[i])});
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
  std::vector<std::string> columns{
      "condition", "group", "patients", "starts", "median_tre_mm", "median_seconds"};
  for (const char* const error : {"tre_", "mrpd_"})
    for (const NamedCell& cell : success_of({})) columns.push_back(error + cell.name);
  columns.emplace_back("success_mm");
  columns.emplace_back("commit");
  CsvTable table(columns);
  for (const PopulationGroup& group : groups) {
    std::vector<std::string> fields{group.condition,
                                    group.group,
                                    std::to_string(group.by_tre.patients.size()),
                                    std::to_string(group.by_tre.starts),
                                    number_text(group.median_tre_mm),
                                    number_text(group.median_seconds)};
    for (const PopulationSuccess* success : {&group.by_tre, &group.by_mrpd})
      for (NamedCell& cell : success_of(*success)) fields.push_back(std::move(cell.text));
    fields.push_back(number_text(success_mm));
    fields.push_back(group.commits);
    table.add_row(std::move(fields));
  }
  return table;
}

CsvTable patients_table(const std::vector<PopulationGroup>& groups) {
  CsvTable table({"condition",
                  "patient",
                  "starts",
                  "tre_successes",
                  "wilson_low",
                  "wilson_high",
                  "capture_mm",
                  "capture_ended_by",
                  "mrpd_successes",
                  "mrpd_capture_mm",
                  "mrpd_capture_ended_by",
                  "commit"});
  for (const PopulationGroup& group : groups) {
    if (group.group != "all") continue;
    for (std::size_t i = 0; i < group.by_tre.patients.size(); ++i) {
      const PatientSuccess& tre = group.by_tre.patients[i];
      const PatientSuccess& mrpd = group.by_mrpd.patients[i];
      table.add_row({group.condition,
                     tre.patient,
                     std::to_string(tre.starts),
                     std::to_string(tre.successes),
                     number_text(tre.wilson.low),
                     number_text(tre.wilson.high),
                     number_text(tre.capture.initial_tre_mm),
                     to_string(tre.capture.end),
                     std::to_string(mrpd.successes),
                     number_text(mrpd.capture.initial_tre_mm),
                     to_string(mrpd.capture.end),
                     group.commits});
    }
  }
  return table;
}

CsvTable intervals_table(const std::vector<PopulationGroup>& groups) {
  CsvTable table({"condition",
                  "error",
                  "low_mm",
                  "high_mm",
                  "starts",
                  "successes",
                  "bootstrap_low",
                  "bootstrap_high",
                  "commit"});
  for (const PopulationGroup& group : groups) {
    if (group.group != "all") continue;
    for (const bool is_tre : {true, false}) {
      const PopulationSuccess& success = is_tre ? group.by_tre : group.by_mrpd;
      for (std::size_t k = 0; k < success.intervals.size(); ++k)
        table.add_row({group.condition,
                       is_tre ? "tre" : "mrpd",
                       number_text(success.intervals[k].low_mm),
                       number_text(success.intervals[k].high_mm),
                       std::to_string(success.intervals[k].trials),
                       std::to_string(success.intervals[k].successes),
                       number_text(success.interval_bootstraps[k].low),
                       number_text(success.interval_bootstraps[k].high),
                       group.commits});
    }
  }
  return table;
}

}  // namespace af::evaluation
