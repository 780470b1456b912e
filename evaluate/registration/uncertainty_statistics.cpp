// SPDX-License-Identifier: Apache-2.0
#include "evaluate/registration/uncertainty_statistics.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <iterator>
#include <utility>
#include <vector>

#include "base/sample_summary.h"
#include "evaluate/registration/case_intervals.h"
#include "evaluate/statistics/patient_names.h"
#include "evaluate/statistics/roc.h"
#include "files/number_json.h"
#include "register/verdict/pose_covariance.h"
#include "register/verdict/verdict.h"

namespace af::evaluation {

using nlohmann::json;

namespace {

constexpr std::array<double, 3> kConfidences = {0.5, 0.9, 0.99};

/// Whether a row's error lies in its region. Rows without a region do not count.
struct Region {
  std::function<bool(const RegistrationRow&)> is_known;
  std::function<bool(const RegistrationRow&)> holds;
};

/// The end with the median error, or the lower of the middle two. `ends` is not empty.
const RegistrationRow& median_end(RowPointers ends) {
  const auto middle = ends.begin() + (std::ssize(ends) - 1) / 2;
  std::nth_element(ends.begin(), middle, ends.end(), [](const auto* a, const auto* b) {
    return a->decisive_mm() < b->decisive_mm();
  });
  return **middle;
}

json coverage_json(const std::map<std::string, RowPointers>& by_case,
                   const StatisticsOptions& options,
                   const Region& region) {
  std::map<std::string, CaseMean> by_patient;
  std::int64_t known = 0;
  std::int64_t held = 0;
  for (const auto& [name, rows] : by_case) {
    RowPointers ends;
    std::copy_if(rows.begin(), rows.end(), std::back_inserter(ends), [&](const auto* row) {
      return row->is_success(options.success_tre_mm) && region.is_known(*row);
    });
    if (ends.empty()) continue;
    const bool is_held = region.holds(median_end(std::move(ends)));
    ++known;
    held += is_held ? 1 : 0;
    CaseMean& patient = by_patient[patient_of_case(name)];
    patient.count += 1.0;
    patient.sum += is_held ? 1.0 : 0.0;
  }
  json result = proportion_json(held, known);
  result["cases"] = known;
  result.erase("starts");
  std::vector<CaseMean> patients;
  for (const auto& [name, mean] : by_patient) patients.push_back(mean);
  result["over_cases"] = interval_over_cases(patients, options.seed);
  return result;
}

double share_at_least(double confidence, const std::vector<double>& values) {
  const auto count = std::count_if(
      values.begin(), values.end(), [&](double value) { return value >= confidence; });
  return static_cast<double>(count) / static_cast<double>(values.size());
}

json confidence_json(const std::vector<double>& successes, const std::vector<double>& failures) {
  json result = {{"successes", successes.size()},
                 {"failures", failures.size()},
                 {"roc_area", number_json(roc_area(successes, failures))},
                 {"at_least", json::array()}};
  for (const double confidence : kConfidences)
    result["at_least"].push_back(
        {{"confidence", confidence},
         {"share_of_successes", number_json(share_at_least(confidence, successes))},
         {"share_of_failures", number_json(share_at_least(confidence, failures))}});
  return result;
}

/// How many right and how many wrong ends have each verdict.
json verdicts_json(const RowPointers& rows, double success_mm) {
  std::map<std::string, std::map<std::string, int>> counts;
  for (const registration::Verdict verdict : registration::kVerdicts)
    counts[to_string(verdict)] = {{"right", 0}, {"wrong", 0}};
  for (const RegistrationRow* row : rows)
    if (!row->verdict.empty())
      ++counts[row->verdict][row->is_success(success_mm) ? "right" : "wrong"];
  return counts;
}

}  // namespace

json uncertainty_statistics(const std::map<std::string, RowPointers>& by_case,
                            const StatisticsOptions& options) {
  std::vector<double> successes;
  std::vector<double> failures;
  std::vector<double> squared_distances;
  RowPointers all;
  for (const auto& [name, rows] : by_case)
    for (const RegistrationRow* row : rows) {
      all.push_back(row);
      const bool is_success = row->is_success(options.success_tre_mm);
      if (std::isfinite(row->uncertainty.confidence))
        (is_success ? successes : failures).push_back(row->uncertainty.confidence);
      if (is_success && std::isfinite(row->squared_distance))
        squared_distances.push_back(row->squared_distance);
    }
  if (successes.empty() && failures.empty() && squared_distances.empty()) return nullptr;
  const Region pose = {
      [](const RegistrationRow& row) { return std::isfinite(row.squared_distance); },
      [](const RegistrationRow& row) {
        return row.squared_distance <= registration::kPoseRegion95;
      }};
  const Region tre = {
      [](const RegistrationRow& row) { return std::isfinite(row.uncertainty.tre_95_mm); },
      [](const RegistrationRow& row) {
        return row.tre_mm <= std::hypot(row.uncertainty.tre_95_mm, row.gold_tre_95_mm);
      }};
  return {{"pose_region_95", coverage_json(by_case, options, pose)},
          {"tre_region_95", coverage_json(by_case, options, tre)},
          {"median_squared_distance", number_json(summarize(squared_distances).median)},
          {"confidence", confidence_json(successes, failures)},
          {"verdicts", verdicts_json(all, options.success_tre_mm)}};
}

}  // namespace af::evaluation
