// SPDX-License-Identifier: Apache-2.0
#include "evaluate/registration/method_comparison.h"

#include <array>
#include <cmath>
#include <map>
#include <utility>

#include <Eigen/Core>

#include "base/error.h"
#include "evaluate/registration/finished_rows.h"
#include "evaluate/registration/registration_statistics.h"
#include "evaluate/report/sample_summary_json.h"
#include "evaluate/starts/perturbed_starts.h"
#include "evaluate/statistics/statistics.h"
#include "files/csv_cells.h"
#include "geometry/target_box.h"

namespace af::evaluation {

using nlohmann::json;

namespace {

/// Bands of initial TRE.
constexpr std::array kBandEndsMm = {0.0, 8.0, 16.0, 30.0};
constexpr std::size_t kBands = kBandEndsMm.size() - 1;

struct Band {
  std::int64_t trials = 0;
  std::int64_t successes = 0;
  double rotation_share = 0.0;
};

/// Registrations of one case by one renderer.
struct Sums {
  std::array<Band, kBands> bands{};
  Eigen::Matrix<double, 6, 1> parameters = Eigen::Matrix<double, 6, 1>::Zero();  ///< of successes
  std::vector<double> error_mm;                                                  ///< of successes
  std::vector<double> depth_mm;            ///< of successes of one view
  std::vector<double> rotation_error_deg;  ///< of successes
  const char* error = "";                  ///< RegistrationRow::decisive_name()
  std::int64_t gross_failures = 0;
  std::int64_t starts = 0;
  std::vector<double> drr_counts;
  std::vector<double> seconds;
};

double rotation_share_of(const RegistrationRow& row, const RunFacts& facts) {
  const FinishedCase& of_case = facts.case_of(row);
  return rotation_share(PoseParameters::from_deg_and_mm(row.start_deg_mm),
                        rms_radius_mm(of_case.target_box_ct, of_case.gold_frame.center_ct_mm));
}

void add_row(const RegistrationRow& row, const RunFacts& facts, Sums& sums) {
  const bool is_success = row.is_success(facts.success_tre_mm);
  ++sums.starts;
  sums.error = row.decisive_name();
  sums.gross_failures += row.decisive_mm() < kGrossFailureMm ? 0 : 1;
  for (std::size_t band = 0; band < kBands; ++band) {
    if (!(row.initial_tre_mm >= kBandEndsMm[band] && row.initial_tre_mm < kBandEndsMm[band + 1]))
      continue;
    ++sums.bands[band].trials;
    sums.bands[band].successes += is_success ? 1 : 0;
    sums.bands[band].rotation_share += rotation_share_of(row, facts);
  }
  sums.drr_counts.push_back(static_cast<double>(row.drr_count));
  if (std::isfinite(row.seconds)) sums.seconds.push_back(row.seconds);
  if (!is_success) return;
  sums.error_mm.push_back(row.decisive_mm());
  if (row.has_one_view) sums.depth_mm.push_back(row.errors.depth_mm);
  if (std::isfinite(row.errors.rotation_deg))
    sums.rotation_error_deg.push_back(row.errors.rotation_deg);
  sums.parameters += Eigen::Map<const Eigen::Matrix<double, 6, 1>>(row.final_deg_mm.data());
}

/// What a run did: method, preset, similarity, optimizer.
CsvCells method_cells(const EvaluationRun& run, const std::string& renderer) {
  if (renderer != "field" && renderer != "raycast")
    return {{"method", renderer}, {"preset", ""}, {"similarity", ""}, {"optimizer", ""}};
  const json& method = run.summary.at("method");
  const auto preset = method.at("preset").get<std::string>();
  const auto similarity = method.at("similarity").get<std::string>();
  const auto optimizer = method.at("optimizer").get<std::string>();
  const bool is_corrected = renderer == "field" && method.value("corrected", false);
  return {
      {"method", preset + " " + similarity + " " + optimizer + (is_corrected ? " corrected" : "")},
      {"preset", preset},
      {"similarity", similarity},
      {"optimizer", optimizer}};
}

/// The case's own capture range of a run's summary.
std::string capture_range_of(const EvaluationRun& run,
                             const std::string& case_name,
                             const std::string& renderer) {
  for (const json& of_renderer : run.summary.at("renderers")) {
    if (of_renderer.at("renderer") != renderer) continue;
    for (const json& of_case : of_renderer.at("cases")) {
      const json& range = of_case.at("capture_range");
      if (of_case.at("case") == case_name && range.is_object())
        return (range.at("is_whole_study").get<bool>() ? "at least " : "") +
               fixed_text(range.at("initial_tre_mm").get<double>(), 0);
    }
  }
  return "-";
}

CsvCells cells_of(const EvaluationRun& run,
                  const std::string& case_name,
                  const std::string& renderer,
                  const Sums& sums) {
  CsvCells cells = {{"run", run.folder.filename().string()}, {"case", case_name}};
  append(method_cells(run, renderer), cells);
  append({{"renderer", renderer}, {"starts", sums.starts}}, cells);
  for (std::size_t i = 0; i < kBands; ++i) {
    const std::string name =
        fixed_text(kBandEndsMm[i], 0) + "_" + fixed_text(kBandEndsMm[i + 1], 0) + "_mm";
    const auto [trials, successes, rotation_share] = sums.bands[i];
    const ProportionInterval wilson = wilson_interval(successes, trials);
    append({{"starts_" + name, trials},
            {"successes_" + name, successes},
            {"wilson_low_" + name, wilson.low},
            {"wilson_high_" + name, wilson.high},
            {"rotation_share_" + name, rotation_share / static_cast<double>(trials)}},
           cells);
  }
  // 0 / 0 without a success gives NaN.
  const auto successes = static_cast<double>(sums.error_mm.size());
  const SampleSummary error = summarize(sums.error_mm);
  const SampleSummary depth = summarize(sums.depth_mm);
  append({{"error", sums.error},
          {"mean_error_mm", error.mean},
          {"median_error_mm", error.median},
          {"median_depth_mm", depth.median},
          {"p95_depth_mm", depth.percentile_95},
          {"rotation_bias_deg", sums.parameters.head<3>().norm() / successes},
          {"translation_bias_mm", sums.parameters.tail<3>().norm() / successes},
          {"median_rotation_error_deg", summarize(sums.rotation_error_deg).median},
          {"gross_failures", sums.gross_failures},
          {"capture_range_mm", capture_range_of(run, case_name, renderer)},
          {"median_drr_count", summarize(sums.drr_counts).median},
          {"median_seconds", summarize(sums.seconds).median}},
         cells);
  return cells;
}

/// A test's p, or the reason why there was no test.
std::string test_text(const json& p, const json& needed, const std::string& what) {
  return p.is_number() ? number_text(number_of(p)) : "fewer than " + needed.dump() + " " + what;
}

std::string claim_text(const json& ends) {
  const json& is_equivalent = ends.at("is_equivalent");
  if (is_equivalent.is_null())
    return "not claimed: " + test_text(ends.at("p"), ends.at("cases_needed"), "patients");
  return is_equivalent.get<bool>() ? "yes" : "not shown";
}

}  // namespace

CsvTable methods_table(const std::vector<EvaluationRun>& runs) {
  std::vector<CsvCells> rows;
  for (const EvaluationRun& run : runs) {
    const RunFacts facts = facts_of(run);
    std::map<std::pair<std::string, std::string>, Sums> sums;
    read_rows(run, facts, [&](const RegistrationRow& row) {
      add_row(row, facts, sums[{row.case_name, row.renderer}]);
    });
    try {
      for (const auto& [key, value] : sums)
        rows.push_back(cells_of(run, key.first, key.second, value));
    } catch (const json::exception&) {
      throw FileError(facts.summary_path,
                      "method, renderers",
                      "preset, similarity, optimizer; capture ranges of every case",
                      "something else");
    }
  }
  if (rows.empty())
    throw InputError("RUN", runs.front().folder.string(), "holds no finished registration run");
  return csv_table(std::move(rows));
}

CsvTable pairs_table(const std::vector<EvaluationRun>& runs) try {
  std::vector<CsvCells> rows;
  for (const EvaluationRun& run : runs) {
    const json& pairs = run.summary.at("field_against_raycast");
    if (!pairs.is_object()) continue;
    const json& ends = pairs.at("end_distance_mm");
    const json& over = ends.at("over_cases");
    rows.push_back(
        {{"run", run.folder.filename().string()},
         {"common_starts", pairs.at("common_starts").dump()},
         {"successes_field", pairs.at("successes").at(0).dump()},
         {"successes_raycast", pairs.at("successes").at(1).dump()},
         {"pairs", pairs.at("pairs").dump()},
         {"patients", over.at("cases").dump()},
         {"mean_distance_mm", number_of(over.at("mean"))},
         {"bootstrap_low_mm", number_of(over.at("low"))},
         {"bootstrap_high_mm", number_of(over.at("high"))},
         {"student_low_mm", number_of(over.at("student_low"))},
         {"student_high_mm", number_of(over.at("student_high"))},
         {"p95_distance_mm", number_of(ends.at("pairs").at("p95"))},
         {"max_distance_mm", number_of(ends.at("pairs").at("max"))},
         {"margin_mm", number_of(ends.at("margin_mm"))},
         {"claim", claim_text(ends)},
         {"p", test_text(ends.at("p"), ends.at("cases_needed"), "patients")},
         {"error_difference_mm", number_of(pairs.at("mean_difference_mm"))},
         {"mcnemar_p", test_text(pairs.at("mcnemar_p"), pairs.at("pairs_needed"), "pairs")},
         {"median_seconds_field", number_of(pairs.at("median_seconds").at(0))},
         {"median_seconds_raycast", number_of(pairs.at("median_seconds").at(1))}});
  }
  return csv_table(std::move(rows));
} catch (const json::exception&) {
  throw FileError(
      "summary.json", "field_against_raycast", "counts and distances", "something else");
}

}  // namespace af::evaluation
