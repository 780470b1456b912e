// SPDX-License-Identifier: Apache-2.0
#include "evaluate/registration/registration_statistics.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <span>
#include <string>
#include <tuple>
#include <utility>

#include "base/joined.h"
#include "evaluate/registration/case_intervals.h"
#include "evaluate/registration/success_statistics.h"
#include "evaluate/registration/uncertainty_statistics.h"
#include "evaluate/report/sample_summary_json.h"
#include "evaluate/statistics/bootstrap.h"
#include "evaluate/statistics/patient_names.h"

namespace af::evaluation {

using nlohmann::json;

namespace {

constexpr std::array<const char*, 5> kErrorNames = {"mrpd_mm",
                                                    "projection_detector_mm",
                                                    "projection_isocenter_mm",
                                                    "rotation_error_deg",
                                                    "translation_error_mm"};

template <typename Value>
std::vector<double> values_of(const RowPointers& rows, const Value& value) {
  std::vector<double> values;
  values.reserve(rows.size());
  for (const RegistrationRow* row : rows) values.push_back(static_cast<double>(value(*row)));
  return values;
}

template <typename Value>
std::vector<double> finite_values_of(const RowPointers& rows, const Value& value) {
  std::vector<double> values = values_of(rows, value);
  std::erase_if(values, [](double each) { return !std::isfinite(each); });
  return values;
}

/// Mean, SD and standard error of the signed final error of each parameter. Over successes, they
/// say how far the optimum itself lies from the gold pose.
json bias_json(const RowPointers& successful) {
  json result = json::object();
  for (std::size_t i = 0; i < kParameterNames.size(); ++i) {
    const std::vector<double> values = finite_values_of(
        successful, [&](const RegistrationRow& row) { return row.final_deg_mm[i]; });
    const SampleSummary summary = summarize(values);
    result[kParameterNames[i]] = {
        {"mean", number_json(summary.mean)},
        {"sd", number_json(summary.standard_deviation)},
        {"standard_error",
         number_json(summary.standard_deviation / std::sqrt(static_cast<double>(values.size())))}};
  }
  return result;
}

/// Quartiles, median and 95th percentile. Missing values count as infinitely far.
json summary_of_all(std::vector<double> values) {
  for (double& value : values)
    if (!std::isfinite(value)) value = std::numeric_limits<double>::infinity();
  const json all = to_json(summarize(std::move(values)));
  json result;
  for (const char* name : {"count", "q1", "median", "q3", "p95", "max"}) result[name] = all[name];
  return result;
}

/// Summaries of each of the errors besides TRE.
template <typename SummaryOf>
json errors_json(const SummaryOf& summary_of) {
  json result = json::object();
  for (std::size_t i = 0; i < kErrorNames.size(); ++i)
    result[kErrorNames[i]] =
        summary_of([i](const RegistrationRow& row) { return row.errors.values()[i]; });
  return result;
}

/// Why a registration failed: "left range" (the start was outside, or the end is pinned at the
/// limit of the field or its motion range), "budget", "numerics" (an exception, or no finite
/// similarity), "no CT in region", "no pose given" (by another program), or "other optimum" for one
/// that converged elsewhere.
std::string failure_reason(const RegistrationRow& row) {
  const std::string& stop = row.stop_reason;
  if (stop == "pinned-at-limit" || stop == "start-inadmissible") return "left range";
  if (stop == "evaluation-budget-spent") return "budget";
  if (stop == "ct-outside-roi") return "no CT in region";
  if (stop == "no-pose") return "no pose given";
  if (stop == "error" || stop == "non-finite-similarity" || !std::isfinite(row.tre_mm))
    return "numerics";
  return "other optimum";
}

RowPointers of_one_view(RowPointers rows) {
  std::erase_if(rows, [](const RegistrationRow* row) { return !row->has_one_view; });
  return rows;
}

/// Success, errors, failure reasons and times of some rows.
json statistics_of(const RowPointers& rows, const StatisticsOptions& options) {
  const auto tre_mm = [](const RegistrationRow& row) { return row.tre_mm; };
  const auto error_mm = [](const RegistrationRow& row) { return row.decisive_mm(); };
  const auto depth_mm = [](const RegistrationRow& row) { return row.errors.depth_mm; };
  RowPointers successful;
  std::set<std::string> errors;
  std::map<std::string, int> stop_reasons;
  std::map<std::string, int> failures;
  for (const RegistrationRow* row : rows) {
    errors.insert(row->decisive_name());
    if (row->is_success(options.success_tre_mm))
      successful.push_back(row);
    else
      ++failures[failure_reason(*row)];
    ++stop_reasons[row->stop_reason];
  }
  const std::vector<double> with_pose_mm = finite_values_of(rows, tre_mm);
  json result = success_statistics(rows, options);
  result["error"] = joined(errors, " or ");
  result["without_pose"] = rows.size() - with_pose_mm.size();
  result["tre_mm"] = to_json(summarize(with_pose_mm));
  result["tre_of_all_mm"] = summary_of_all(values_of(rows, tre_mm));
  result["tre_of_successes_mm"] = to_json(summarize(values_of(successful, tre_mm)));
  result["error_of_all_mm"] = summary_of_all(values_of(rows, error_mm));
  result["error_of_successes_mm"] = to_json(summarize(values_of(successful, error_mm)));
  result["depth_of_all_mm"] = summary_of_all(values_of(of_one_view(rows), depth_mm));
  result["depth_of_successes_mm"] =
      to_json(summarize(finite_values_of(of_one_view(successful), depth_mm)));
  result["bias"] = bias_json(successful);
  result["errors_of_successes"] = errors_json(
      [&](const auto& error) { return to_json(summarize(finite_values_of(successful, error))); });
  result["errors_of_all"] =
      errors_json([&](const auto& error) { return summary_of_all(values_of(rows, error)); });
  result["stop_reasons"] = stop_reasons;
  result["failures_by_reason"] = failures;
  // Other programs need not state seconds.
  result["seconds"] = to_json(
      summarize(finite_values_of(rows, [](const RegistrationRow& row) { return row.seconds; })));
  result["evaluations"] = to_json(
      summarize(values_of(rows, [](const RegistrationRow& row) { return row.evaluations; })));
  result["drr_count"] =
      to_json(summarize(values_of(rows, [](const RegistrationRow& row) { return row.drr_count; })));
  return result;
}

/// Intervals over patients of the success rate, of the mean error of successes and of capture
/// ranges.
json over_patients_json(const std::map<std::string, RowPointers>& by_patient,
                        const StatisticsOptions& options) {
  std::vector<CaseMean> rates;
  std::vector<CaseMean> successful_mm;
  for (const auto& [name, rows] : by_patient) {
    CaseMean error_mm;
    for (const RegistrationRow* row : rows) {
      if (!row->is_success(options.success_tre_mm)) continue;
      error_mm.sum += row->decisive_mm();
      error_mm.count += 1.0;
    }
    successful_mm.push_back(error_mm);
    rates.push_back({error_mm.count, static_cast<double>(rows.size())});
  }
  json result = {{"rate", interval_over_cases(rates, options.seed)},
                 {"mean_error_of_successes_mm", interval_over_cases(successful_mm, options.seed)}};
  add_capture_over_patients(by_patient, options, result);
  // Student's interval is cut because it does not know that rates end at 0 and 1.
  for (const char* name : {"student_low", "student_high"})
    if (json& end = result["rate"][name]; end.is_number())
      end = std::clamp(end.get<double>(), 0.0, 1.0);
  return result;
}

/// Rows whose renderer, case and start index an earlier row has too, in ascending order.
RowPointers repeated_rows(std::span<const RegistrationRow> rows) {
  const auto key = [](const RegistrationRow* row) {
    return std::tie(row->case_name, row->renderer, row->start_index);
  };
  RowPointers sorted;
  sorted.reserve(rows.size());
  for (const RegistrationRow& row : rows) sorted.push_back(&row);
  std::sort(sorted.begin(), sorted.end(), [&](const RegistrationRow* a, const RegistrationRow* b) {
    return key(a) != key(b) ? key(a) < key(b) : a < b;
  });
  RowPointers repeated;
  for (std::size_t i = 1; i < sorted.size(); ++i)
    if (key(sorted[i - 1]) == key(sorted[i])) repeated.push_back(sorted[i]);
  std::sort(repeated.begin(), repeated.end());
  return repeated;
}

}  // namespace

json renderer_statistics(std::span<const RegistrationRow> rows,
                         const std::string& renderer,
                         const StatisticsOptions& options) {
  RowPointers mine;
  std::map<std::string, RowPointers> by_case;
  std::vector<double> stated_pose_tre_mm;
  for (const RegistrationRow& row : rows) {
    if (row.renderer != renderer) continue;
    mine.push_back(&row);
    by_case[row.case_name].push_back(&row);
    if (row.is_success(options.success_tre_mm) && std::isfinite(row.stated_pose_tre_mm))
      stated_pose_tre_mm.push_back(row.stated_pose_tre_mm);
  }
  std::map<std::string, RowPointers> by_patient;
  for (const auto& [name, case_rows] : by_case) {
    RowPointers& patient_rows = by_patient[patient_of_case(name)];
    patient_rows.insert(patient_rows.end(), case_rows.begin(), case_rows.end());
  }
  json result = statistics_of(mine, options);
  result["renderer"] = renderer;
  result["stated_pose_tre_of_successes_mm"] = to_json(summarize(stated_pose_tre_mm));
  std::int64_t inside = 0;
  for (const json& interval : result["intervals"]) inside += interval["starts"].get<std::int64_t>();
  result["starts_beyond_last_interval"] = static_cast<std::int64_t>(mine.size()) - inside;
  result["over_cases"] = over_patients_json(by_patient, options);
  if (json uncertainty = uncertainty_statistics(by_case, options); !uncertainty.is_null())
    result["uncertainty"] = std::move(uncertainty);
  result["cases"] = json::array();
  for (const auto& [name, case_rows] : by_case) {
    json entry = statistics_of(case_rows, options);
    entry["case"] = name;
    result["cases"].push_back(entry);
  }
  return result;
}

std::vector<std::string> row_problems(std::span<const RegistrationRow> rows) {
  std::vector<std::string> found;
  const RowPointers repeated = repeated_rows(rows);
  for (const RegistrationRow& row : rows) {
    const auto add = [&](const char* problem) {
      found.push_back(row.case_name + ", " + row.renderer + ", start " +
                      std::to_string(row.start_index) + ": " + problem);
    };
    if (std::binary_search(repeated.begin(), repeated.end(), &row)) add("occurs more than once");
    if (!std::isfinite(row.initial_tre_mm)) add("has no initial TRE");
    const bool has_parameters = std::all_of(row.final_deg_mm.begin(),
                                            row.final_deg_mm.end(),
                                            [](double value) { return std::isfinite(value); });
    if (std::isfinite(row.tre_mm) != has_parameters)
      add("final pose and TRE do not belong together");
  }
  return found;
}

std::size_t patient_count(std::span<const std::string> case_names) {
  std::set<std::string> patients;
  for (const std::string& name : case_names) patients.insert(patient_of_case(name));
  return patients.size();
}

std::vector<std::string> warnings_about_patients(std::size_t patients) {
  if (patients >= kEnoughCases) return {};
  if (patients < 2)
    return {
        "one patient: intervals hold for other starts, not for other patients, and there are none "
        "over patients"};
  return {std::to_string(patients) +
          " patients: the bootstrap interval over patients is too narrow below " +
          std::to_string(kEnoughCases) +
          " of them; take Student's interval beside it (docs/errors.md)"};
}

}  // namespace af::evaluation
