// SPDX-License-Identifier: Apache-2.0
#include "evaluate/registration/paired_statistics.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <tuple>
#include <vector>

#include "base/sample_summary.h"
#include "evaluate/registration/case_intervals.h"
#include "evaluate/report/sample_summary_json.h"
#include "evaluate/statistics/case_equivalence.h"
#include "evaluate/statistics/patient_names.h"
#include "evaluate/statistics/signed_rank_test.h"
#include "evaluate/statistics/statistics.h"

namespace af::evaluation {

using nlohmann::json;

namespace {

/// Field and ray casting from one start.
struct StartPair {
  const RegistrationRow* field = nullptr;
  const RegistrationRow* raycast = nullptr;
};

bool is_earlier_start(const RegistrationRow* a, const RegistrationRow* b) {
  return std::tie(a->case_name, a->start_index) < std::tie(b->case_name, b->start_index);
}

/// Rows by case and start index; repeated rows leave the last. Pointers are enough: a map of
/// millions of rows would need more memory than the rows themselves.
RowPointers rows_by_start(std::span<const RegistrationRow> rows, const std::string& renderer) {
  RowPointers found;
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
  const RowPointers raycast = rows_by_start(rows, "raycast");
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

/// Sums over the pairs of one patient.
struct PatientPairs {
  CaseMean error_difference_mm;  ///< field minus ray casting, where both succeeded
  CaseMean success_difference;   ///< field minus ray casting, every common start
  CaseMean end_distance_mm;      ///< where both succeeded
};

/// All pairs of a run.
struct PairSums {
  std::array<std::vector<double>, 2> seconds;
  std::vector<double> field_error_mm;        ///< where both succeeded
  std::vector<double> raycast_error_mm;      ///< the same
  std::vector<double> error_differences_mm;  ///< the same: field minus ray casting
  std::vector<double> distances_mm;          ///< the same
  std::vector<double> all_distances_mm;      ///< where both have an end pose
  std::int64_t only_field = 0;
  std::int64_t only_raycast = 0;
  std::map<std::string, PatientPairs> patients;

  void add(const StartPair& pair, const PairedOptions& options);
};

void PairSums::add(const StartPair& pair, const PairedOptions& options) {
  PatientPairs& of_patient = patients[patient_of_case(pair.field->case_name)];
  seconds[0].push_back(pair.field->seconds);
  seconds[1].push_back(pair.raycast->seconds);
  const bool field = pair.field->is_success(options.success_tre_mm);
  const bool raycast = pair.raycast->is_success(options.success_tre_mm);
  only_field += field && !raycast ? 1 : 0;
  only_raycast += raycast && !field ? 1 : 0;
  of_patient.success_difference.sum += (field ? 1.0 : 0.0) - (raycast ? 1.0 : 0.0);
  of_patient.success_difference.count += 1.0;
  const double distance_mm =
      options.end_distance_mm ? options.end_distance_mm(*pair.field, *pair.raycast) : kNan;
  if (std::isfinite(distance_mm)) all_distances_mm.push_back(distance_mm);
  if (!field || !raycast) return;
  field_error_mm.push_back(pair.field->decisive_mm());
  raycast_error_mm.push_back(pair.raycast->decisive_mm());
  error_differences_mm.push_back(field_error_mm.back() - raycast_error_mm.back());
  of_patient.error_difference_mm.sum += error_differences_mm.back();
  of_patient.error_difference_mm.count += 1.0;
  if (!std::isfinite(distance_mm)) return;
  distances_mm.push_back(distance_mm);
  of_patient.end_distance_mm.sum += distance_mm;
  of_patient.end_distance_mm.count += 1.0;
}

json test_json(const PairSums& sums, double margin_mm) {
  const PairedComparison comparison =
      compare_paired(sums.field_error_mm, sums.raycast_error_mm, margin_mm);
  const SignedRankTest ranks = signed_rank_test(sums.error_differences_mm);
  const double sd = comparison.standard_error * std::sqrt(static_cast<double>(comparison.pairs));
  return {{"sd_mm", sd},
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

/// One of the means, for every patient that has it.
std::vector<CaseMean> means_of(const std::map<std::string, PatientPairs>& patients,
                               CaseMean PatientPairs::*member) {
  std::vector<CaseMean> means;
  for (const auto& [name, of_patient] : patients)
    if ((of_patient.*member).count > 0.0) means.push_back(of_patient.*member);
  return means;
}

/// Methods that succeed from different starts are not equivalent, however close their ends are
/// where both succeed. The difference of success rates must therefore be small too.
constexpr double kSuccessMargin = 0.05;

/// Whether both 95 % intervals over patients of the success difference lie within the margin.
/// Student's has no ends where all patients are alike. The bootstrap's ends are then their common
/// value.
bool succeeds_alike(const PairSums& sums, std::uint64_t seed) {
  const json interval =
      interval_over_cases(means_of(sums.patients, &PatientPairs::success_difference), seed);
  const auto is_small = [&](const char* end) {
    return interval[end].is_number() && std::abs(interval[end].get<double>()) <= kSuccessMargin;
  };
  const bool has_spread = interval["student_low"].is_number();
  return is_small("low") && is_small("high") &&
         (!has_spread || (is_small("student_low") && is_small("student_high")));
}

/// Every patient counts the same, however many pairs it has.
json end_distance_json(const PairSums& sums, const PairedOptions& options) {
  std::vector<double> patient_means_mm;
  for (const CaseMean& mean : means_of(sums.patients, &PatientPairs::end_distance_mm))
    patient_means_mm.push_back(mean.sum / mean.count);
  const CaseEquivalence found =
      equivalence_over_cases(patient_means_mm, options.margin_mm, options.seed);
  const auto patients_without_pairs =
      static_cast<std::int64_t>(sums.patients.size() - patient_means_mm.size());
  json over_cases = bootstrap_json(found.bootstrap);
  over_cases["mean"] = number_json(found.mean);
  over_cases["student_low"] = number_json(found.student.low);
  over_cases["student_high"] = number_json(found.student.high);
  json result = {{"pairs", to_json(summarize(sums.distances_mm))},
                 {"all", to_json(summarize(sums.all_distances_mm))},
                 {"over_cases", over_cases},
                 {"margin_mm", options.margin_mm},
                 {"p", found.has_enough_cases() ? number_json(found.p) : json(nullptr)},
                 {"cases_needed", kEnoughCasesForEquivalence},
                 {"cases_without_pairs", patients_without_pairs},
                 {"success_margin", kSuccessMargin},
                 {"has_enough_cases", found.has_enough_cases()}};
  // With too few patients nothing is claimed either way.
  const bool is_shown =
      found.is_shown() && patients_without_pairs == 0 && succeeds_alike(sums, options.seed);
  result["is_equivalent"] = found.has_enough_cases() ? json(is_shown) : json(nullptr);
  return result;
}

}  // namespace

json paired_statistics(std::span<const RegistrationRow> rows, const PairedOptions& options) {
  PairSums sums;
  for (const StartPair& pair : pairs_of(rows)) sums.add(pair, options);
  if (sums.seconds[0].empty()) return nullptr;
  const auto both = static_cast<std::int64_t>(sums.field_error_mm.size());
  json result = {
      {"common_starts", sums.seconds[0].size()},
      {"successes", {both + sums.only_field, both + sums.only_raycast}},
      {"pairs_needed", kLeastPairsOfATest},
      {"mcnemar_p",
       sums.seconds[0].size() < kLeastPairsOfATest
           ? json(nullptr)
           : json(mcnemar_exact_p(sums.only_field, sums.only_raycast))},
      {"median_seconds", {summarize(sums.seconds[0]).median, summarize(sums.seconds[1]).median}},
      {"pairs", both}};
  result["success_difference_over_cases"] =
      interval_over_cases(means_of(sums.patients, &PatientPairs::success_difference), options.seed);
  if (options.end_distance_mm) result["end_distance_mm"] = end_distance_json(sums, options);
  result["mean_difference_mm"] = number_json(mean_of(sums.error_differences_mm));
  if (sums.error_differences_mm.size() >= kLeastPairsOfATest)
    result["test"] = test_json(sums, options.margin_mm);
  result["mean_difference_over_cases_mm"] = interval_over_cases(
      means_of(sums.patients, &PatientPairs::error_difference_mm), options.seed);
  return result;
}

}  // namespace af::evaluation
