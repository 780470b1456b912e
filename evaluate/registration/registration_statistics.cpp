// SPDX-License-Identifier: Apache-2.0
#include "evaluate/registration/registration_statistics.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <span>
#include <string>
#include <tuple>
#include <utility>

#include "evaluate/outputs/sample_summary_json.h"
#include "evaluate/statistics/bootstrap.h"
#include "evaluate/statistics/signed_rank_test.h"
#include "evaluate/statistics/statistics.h"

namespace af::evaluation {

using nlohmann::json;

namespace {

using Rows = std::vector<const RegistrationRow*>;

constexpr std::array<double, 5> kThresholdsMm = {1.0, 2.0, kSuccessTreMm, 5.0, 10.0};
constexpr std::array<const char*, 5> kErrorNames = {"mrpd_mm",
                                                    "projection_detector_mm",
                                                    "projection_isocenter_mm",
                                                    "rotation_error_deg",
                                                    "translation_error_mm"};

bool is_success(const RegistrationRow& row) {
  return row.tre_mm < kSuccessTreMm;
}

json proportion_json(std::int64_t successes, std::int64_t trials) {
  const ProportionInterval wilson = wilson_interval(successes, trials);
  return {{"successes", successes},
          {"starts", trials},
          {"rate",
           trials > 0 ? json(static_cast<double>(successes) / static_cast<double>(trials))
                      : json(nullptr)},
          {"wilson_low", wilson.low},
          {"wilson_high", wilson.high}};
}

json interval_json(const IntervalSuccess& interval) {
  json result = proportion_json(interval.successes, interval.trials);
  result["low_mm"] = interval.low_mm;
  result["high_mm"] = interval.high_mm;
  return result;
}

json capture_json(const std::vector<TreOutcome>& outcomes) {
  const std::optional<CaptureRange> range = capture_range(outcomes);
  if (!range.has_value()) return nullptr;
  return {{"initial_tre_mm", range->initial_tre_mm},
          {"starts", range->starts},
          {"successes", range->successes},
          {"is_whole_study", range->is_whole_study}};
}

/// Mean, SD and standard error of the signed final error of each parameter over the successes: how
/// far the optimum itself lies from the gold pose.
json bias_json(const Rows& rows) {
  json result = json::object();
  for (std::size_t i = 0; i < kParameterNames.size(); ++i) {
    std::vector<double> values;
    for (const RegistrationRow* row : rows)
      if (is_success(*row) && std::isfinite(row->final_deg_mm[i]))
        values.push_back(row->final_deg_mm[i]);
    const SampleSummary summary = summarize(values);
    result[kParameterNames[i]] = {
        {"mean", number_json(summary.mean)},
        {"sd", number_json(summary.standard_deviation)},
        {"standard_error",
         number_json(summary.standard_deviation / std::sqrt(static_cast<double>(values.size())))}};
  }
  return result;
}

/// The errors beside TRE, over successes.
json errors_json(const Rows& rows) {
  json result = json::object();
  for (std::size_t i = 0; i < kErrorNames.size(); ++i) {
    std::vector<double> values;
    for (const RegistrationRow* row : rows)
      if (is_success(*row) && std::isfinite(row->errors.values()[i]))
        values.push_back(row->errors.values()[i]);
    result[kErrorNames[i]] = to_json(summarize(values));
  }
  return result;
}

json thresholds_json(const std::vector<TreOutcome>& outcomes) {
  json result = json::array();
  for (const double threshold : kThresholdsMm) {
    json entry = proportion_json(count_successes(outcomes, threshold),
                                 static_cast<std::int64_t>(outcomes.size()));
    entry["threshold_mm"] = threshold;
    result.push_back(entry);
  }
  return result;
}

/// Quartiles, median and 95th percentile, where missing values count as infinitely far.
json summary_of_all(std::vector<double> values) {
  for (double& value : values)
    if (!std::isfinite(value)) value = std::numeric_limits<double>::infinity();
  const json all = to_json(summarize(std::move(values)));
  json result;
  for (const char* name : {"count", "q1", "median", "q3", "p95", "max"}) result[name] = all[name];
  return result;
}

/// The errors beside TRE, over all.
json errors_of_all_json(const Rows& rows) {
  json result = json::object();
  for (std::size_t i = 0; i < kErrorNames.size(); ++i) {
    std::vector<double> values;
    for (const RegistrationRow* row : rows) values.push_back(row->errors.values()[i]);
    result[kErrorNames[i]] = summary_of_all(std::move(values));
  }
  return result;
}

/// Success and TRE of some rows.
json accuracy_of(const Rows& rows) {
  std::vector<TreOutcome> outcomes;
  std::vector<double> tre_mm;
  std::vector<double> all_tre_mm;
  std::vector<double> successful_tre_mm;
  for (const RegistrationRow* row : rows) {
    outcomes.push_back({row->initial_tre_mm, row->tre_mm});
    if (std::isfinite(row->tre_mm)) tre_mm.push_back(row->tre_mm);
    all_tre_mm.push_back(row->tre_mm);
    if (is_success(*row)) successful_tre_mm.push_back(row->tre_mm);
  }
  const auto trials = static_cast<std::int64_t>(outcomes.size());
  json result = proportion_json(count_successes(outcomes, kSuccessTreMm), trials);
  result["without_pose"] = outcomes.size() - tre_mm.size();
  result["tre_mm"] = to_json(summarize(tre_mm));
  result["tre_of_all_mm"] = summary_of_all(std::move(all_tre_mm));
  result["tre_of_successes_mm"] = to_json(summarize(successful_tre_mm));
  result["thresholds"] = thresholds_json(outcomes);
  result["gross_failures"] =
      proportion_json(trials - count_successes(outcomes, kGrossFailureTreMm), trials);
  result["capture_range"] = capture_json(outcomes);
  return result;
}

/// Success, TRE, other errors, reasons and times of some rows.
json statistics_of(const Rows& rows) {
  json result = accuracy_of(rows);
  result["bias"] = bias_json(rows);
  result["errors_of_successes"] = errors_json(rows);
  result["errors_of_all"] = errors_of_all_json(rows);
  std::vector<double> seconds;
  std::vector<double> evaluations;
  std::vector<double> drr_counts;
  std::map<std::string, int> stop_reasons;
  std::map<std::string, int> failures;
  for (const RegistrationRow* row : rows) {
    // Other programs need not state this.
    if (std::isfinite(row->seconds)) seconds.push_back(row->seconds);
    evaluations.push_back(static_cast<double>(row->evaluations));
    drr_counts.push_back(static_cast<double>(row->drr_count));
    ++stop_reasons[row->stop_reason];
    if (!is_success(*row)) ++failures[failure_reason(*row)];
  }
  result["stop_reasons"] = stop_reasons;
  result["failures_by_reason"] = failures;
  result["seconds"] = to_json(summarize(seconds));
  result["evaluations"] = to_json(summarize(evaluations));
  result["drr_count"] = to_json(summarize(drr_counts));
  return result;
}

json bootstrap_json(const CaseBootstrap& bootstrap) {
  return {{"cases", bootstrap.cases},
          {"replicates", bootstrap.replicates},
          {"undefined", bootstrap.undefined},
          {"low", number_json(bootstrap.low)},
          {"high", number_json(bootstrap.high)},
          {"is_optimistic", bootstrap.is_optimistic()}};
}

/// A mean over one case, as a sum and the number of its terms.
struct CaseMean {
  double sum = 0.0;
  double count = 0.0;
};

/// Intervals by bootstrap over cases, and Student's interval of the cases' own means, in which
/// every case has the same weight.
json interval_over_cases(const std::vector<CaseMean>& cases, std::uint64_t seed) {
  json result = bootstrap_json(bootstrap_over_cases(
      cases.size(),
      [&](std::span<const std::size_t> drawn) {
        CaseMean all;
        for (const std::size_t index : drawn) {
          all.sum += cases[index].sum;
          all.count += cases[index].count;
        }
        return all.sum / all.count;
      },
      seed));
  std::vector<double> means;
  for (const CaseMean& mean : cases)
    if (mean.count > 0.0) means.push_back(mean.sum / mean.count);
  const MeanInterval student = student_interval(means);
  result["student_low"] = number_json(student.low);
  result["student_high"] = number_json(student.high);
  return result;
}

/// Intervals over cases of the success rate and of the mean TRE of successes.
json over_cases_json(const std::map<std::string, Rows>& by_case, std::uint64_t seed) {
  std::vector<CaseMean> rates;
  std::vector<CaseMean> successful_tre_mm;
  for (const auto& [name, rows] : by_case) {
    CaseMean tre_mm;
    for (const RegistrationRow* row : rows) {
      if (!is_success(*row)) continue;
      tre_mm.sum += row->tre_mm;
      tre_mm.count += 1.0;
    }
    successful_tre_mm.push_back(tre_mm);
    rates.push_back({tre_mm.count, static_cast<double>(rows.size())});
  }
  json result = {{"rate", interval_over_cases(rates, seed)},
                 {"mean_tre_of_successes_mm", interval_over_cases(successful_tre_mm, seed)}};
  // Student's interval does not know that rates end at 0 and 1.
  for (const char* name : {"student_low", "student_high"})
    if (json& end = result["rate"][name]; end.is_number())
      end = std::clamp(end.get<double>(), 0.0, 1.0);
  return result;
}

/// Field and ray casting from one start.
struct StartPair {
  const RegistrationRow* field = nullptr;
  const RegistrationRow* raycast = nullptr;
};

bool is_earlier_start(const RegistrationRow* a, const RegistrationRow* b) {
  return std::tie(a->case_name, a->start_index) < std::tie(b->case_name, b->start_index);
}

/// Rows by case and start index; of repeated rows the last. Millions of rows are looked at through
/// pointers: a map of them would need more memory than they do.
Rows rows_by_start(std::span<const RegistrationRow> rows, const std::string& renderer) {
  Rows found;
  for (const RegistrationRow& row : rows)
    if (row.renderer == renderer) found.push_back(&row);
  std::stable_sort(found.begin(), found.end(), is_earlier_start);
  const auto kept = std::unique(
      found.rbegin(), found.rend(), [](const RegistrationRow* later, const RegistrationRow* row) {
        return !is_earlier_start(row, later);
      });
  found.erase(found.begin(), kept.base());
  return found;
}

std::vector<StartPair> pairs_of(std::span<const RegistrationRow> rows) {
  const Rows raycast = rows_by_start(rows, "raycast");
  if (raycast.empty()) return {};
  std::vector<StartPair> pairs;
  auto next = raycast.begin();
  for (const RegistrationRow* field : rows_by_start(rows, "field")) {
    next = std::lower_bound(next, raycast.end(), field, is_earlier_start);
    if (next == raycast.end()) break;
    if (!is_earlier_start(field, *next)) pairs.push_back({field, *next});
  }
  return pairs;
}

/// Rows whose renderer, case and start index an earlier row has, too; ascending.
Rows repeated_rows(std::span<const RegistrationRow> rows) {
  const auto key = [](const RegistrationRow* row) {
    return std::tie(row->case_name, row->renderer, row->start_index);
  };
  Rows sorted;
  sorted.reserve(rows.size());
  for (const RegistrationRow& row : rows) sorted.push_back(&row);
  std::sort(sorted.begin(), sorted.end(), [&](const RegistrationRow* a, const RegistrationRow* b) {
    return key(a) != key(b) ? key(a) < key(b) : a < b;
  });
  Rows repeated;
  for (std::size_t i = 1; i < sorted.size(); ++i)
    if (key(sorted[i - 1]) == key(sorted[i])) repeated.push_back(sorted[i]);
  std::sort(repeated.begin(), repeated.end());
  return repeated;
}

json test_json(const std::vector<double>& field_tre_mm,
               const std::vector<double>& raycast_tre_mm,
               double margin_mm) {
  const PairedComparison comparison = compare_paired(field_tre_mm, raycast_tre_mm, margin_mm);
  std::vector<double> differences;
  for (std::size_t i = 0; i < field_tre_mm.size(); ++i)
    differences.push_back(field_tre_mm[i] - raycast_tre_mm[i]);
  const SignedRankTest ranks = signed_rank_test(differences);
  const double sd = comparison.standard_error * std::sqrt(static_cast<double>(comparison.pairs));
  return {{"mean_difference_mm", comparison.mean_difference},
          {"sd_mm", sd},
          {"low_90_mm", comparison.low_90},
          {"high_90_mm", comparison.high_90},
          {"t_test_p", comparison.t_test_p},
          {"signed_rank_p", ranks.p},
          {"signed_rank_is_exact", ranks.is_exact},
          {"margin_mm", comparison.margin},
          {"equivalence_p", comparison.equivalence_p},
          {"equivalence_power", comparison.equivalence_power},
          {"pairs_for_power_90", pairs_for_equivalence(sd, margin_mm)}};
}

}  // namespace

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

json renderer_statistics(std::span<const RegistrationRow> rows,
                         const std::string& renderer,
                         const StatisticsOptions& options) {
  Rows mine;
  std::map<std::string, Rows> by_case;
  std::vector<double> stated_pose_tre_mm;
  for (const RegistrationRow& row : rows) {
    if (row.renderer != renderer) continue;
    mine.push_back(&row);
    by_case[row.case_name].push_back(&row);
    if (is_success(row) && std::isfinite(row.stated_pose_tre_mm))
      stated_pose_tre_mm.push_back(row.stated_pose_tre_mm);
  }
  json result = statistics_of(mine);
  result["renderer"] = renderer;
  result["stated_pose_tre_of_successes_mm"] = to_json(summarize(stated_pose_tre_mm));
  result["intervals"] = json::array();
  std::int64_t inside = 0;
  for (const IntervalSuccess& interval : success_per_interval(
           outcomes_of(rows, renderer), options.intervals, options.interval_width_mm)) {
    result["intervals"].push_back(interval_json(interval));
    inside += interval.trials;
  }
  result["starts_beyond_last_interval"] = static_cast<std::int64_t>(mine.size()) - inside;
  result["over_cases"] = over_cases_json(by_case, options.seed);
  result["cases"] = json::array();
  for (const auto& [name, case_rows] : by_case) {
    json entry = statistics_of(case_rows);
    entry["case"] = name;
    result["cases"].push_back(entry);
  }
  return result;
}

json paired_statistics(std::span<const RegistrationRow> rows,
                       double margin_mm,
                       std::uint64_t seed) {
  std::array<std::vector<double>, 2> seconds;
  std::vector<double> field_tre_mm;
  std::vector<double> raycast_tre_mm;
  std::map<std::string, CaseMean> differences_mm;
  std::int64_t only_field = 0;
  std::int64_t only_raycast = 0;
  for (const StartPair& pair : pairs_of(rows)) {
    seconds[0].push_back(pair.field->seconds);
    seconds[1].push_back(pair.raycast->seconds);
    const bool field = is_success(*pair.field);
    const bool raycast = is_success(*pair.raycast);
    only_field += field && !raycast ? 1 : 0;
    only_raycast += raycast && !field ? 1 : 0;
    if (!field || !raycast) continue;
    field_tre_mm.push_back(pair.field->tre_mm);
    raycast_tre_mm.push_back(pair.raycast->tre_mm);
    CaseMean& difference_mm = differences_mm[pair.field->case_name];
    difference_mm.sum += pair.field->tre_mm - pair.raycast->tre_mm;
    difference_mm.count += 1.0;
  }
  if (seconds[0].empty()) return nullptr;
  const auto both = static_cast<std::int64_t>(field_tre_mm.size());
  json result = {{"common_starts", seconds[0].size()},
                 {"successes", {both + only_field, both + only_raycast}},
                 {"mcnemar_p", mcnemar_exact_p(only_field, only_raycast)},
                 {"median_seconds", {summarize(seconds[0]).median, summarize(seconds[1]).median}},
                 {"pairs", both}};
  if (both >= 2) result["test"] = test_json(field_tre_mm, raycast_tre_mm, margin_mm);
  std::vector<CaseMean> case_differences_mm;
  case_differences_mm.reserve(differences_mm.size());
  for (const auto& [name, difference_mm] : differences_mm)
    case_differences_mm.push_back(difference_mm);
  result["mean_difference_over_cases_mm"] = interval_over_cases(case_differences_mm, seed);
  return result;
}

std::vector<std::string> row_problems(std::span<const RegistrationRow> rows) {
  std::vector<std::string> found;
  const Rows repeated = repeated_rows(rows);
  for (const RegistrationRow& row : rows) {
    const auto add = [&](const char* problem) {
      found.push_back(row.case_name.text() + ", " + row.renderer.text() + ", start " +
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

std::vector<std::string> warnings_about_cases(std::size_t cases) {
  if (cases >= kEnoughCases) return {};
  if (cases < 2)
    return {
        "one case: its intervals hold for other starts of this patient and say nothing about "
        "other patients"};
  return {std::to_string(cases) + " cases: the bootstrap interval over cases is too narrow below " +
          std::to_string(kEnoughCases) +
          " cases; take Student's interval beside it (docs/errors.md)"};
}

}  // namespace af::evaluation
