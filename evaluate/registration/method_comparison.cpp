// SPDX-License-Identifier: Apache-2.0
#include "evaluate/registration/method_comparison.h"

#include <array>
#include <cmath>
#include <iterator>
#include <map>
#include <utility>

#include <Eigen/Core>

#include "base/error.h"
#include "evaluate/outputs/sample_summary_json.h"
#include "evaluate/registration/registration_statistics.h"
#include "evaluate/starts/perturbed_starts.h"
#include "evaluate/statistics/statistics.h"
#include "gold_standard/target_box.h"

namespace af::evaluation {

using nlohmann::json;

namespace {

constexpr std::size_t kBands = std::size(kBandEndsMm) - 1;

/// Registrations of one case by one renderer.
struct Sums {
  std::array<IntervalSuccess, kBands> bands{};
  Eigen::Matrix<double, 6, 1> parameters = Eigen::Matrix<double, 6, 1>::Zero();
  std::vector<double> tre_mm;              ///< of successes
  std::vector<double> rotation_error_deg;  ///< of successes
  std::array<double, kBands> rotation_share{};
  std::vector<double> mrpd_mm;  ///< of those below the threshold by mRPD
  std::int64_t gross_failures = 0;
  std::int64_t starts = 0;
  std::vector<double> drr_counts;
  std::vector<double> seconds;
};

/// Facts from a run's summary that are needed to read its rows.
struct RunFacts {
  double success_tre_mm = kSuccessTreMm;
  std::map<std::string, double> radius_mm;  ///< of the cases' target boxes, about their centres
};

Eigen::Vector3d point_in(const json& values) {
  return {values.at(0).get<double>(), values.at(1).get<double>(), values.at(2).get<double>()};
}

/// Runs of earlier versions do not state all of it.
RunFacts facts_of(const EvaluationRun& run) {
  RunFacts facts;
  const json threshold = run.summary.value("success_tre_mm", json());
  if (threshold.is_number()) facts.success_tre_mm = threshold.get<double>();
  try {
    for (const json& of_case : run.summary.value("cases", json::array())) {
      if (!of_case.contains("target_box_ct_mm") || !of_case.contains("center_ct_mm")) continue;
      const json& box = of_case.at("target_box_ct_mm");
      facts.radius_mm[of_case.at("case").get<std::string>()] = rms_radius_mm(
          {point_in(box.at(0)), point_in(box.at(1))}, point_in(of_case.at("center_ct_mm")));
    }
  } catch (const json::exception&) {
    throw FileError((run.folder / "summary.json").string(),
                    "cases",
                    "a name, a box of two points and a centre",
                    "something else");
  }
  return facts;
}

double rotation_share_of(const CsvTable& table, std::size_t row, const RunFacts& facts) {
  const auto radius_mm = facts.radius_mm.find(table.text(row, "case"));
  if (radius_mm == facts.radius_mm.end()) return kNan;
  std::array<double, 6> start{};
  for (std::size_t i = 0; i < start.size(); ++i)
    start[i] = table.number(row, std::string("start_") + kParameterNames[i]);
  return rotation_share(PoseParameters::from_deg_and_mm(start), radius_mm->second);
}

void add_row(const CsvTable& table, std::size_t row, const RunFacts& facts, Sums& sums) {
  const double initial_mm = table.number(row, "initial_tre_mm");
  const double tre_mm = table.number_or_nan(row, "tre_mm");
  const bool is_success = tre_mm < facts.success_tre_mm;
  ++sums.starts;
  sums.gross_failures += tre_mm < kGrossFailureMm ? 0 : 1;
  if (const double mrpd_mm = table.number_or_nan(row, "mrpd_mm"); mrpd_mm < facts.success_tre_mm)
    sums.mrpd_mm.push_back(mrpd_mm);
  for (std::size_t band = 0; band < kBands; ++band) {
    if (!(initial_mm >= kBandEndsMm[band] && initial_mm < kBandEndsMm[band + 1])) continue;
    ++sums.bands[band].trials;
    sums.bands[band].successes += is_success ? 1 : 0;
    sums.rotation_share[band] += rotation_share_of(table, row, facts);
  }
  sums.drr_counts.push_back(table.number(row, "drr_count"));
  const double seconds = table.number_or_nan(row, "seconds");
  if (std::isfinite(seconds)) sums.seconds.push_back(seconds);
  if (!is_success) return;
  sums.tre_mm.push_back(tre_mm);
  const double rotation_deg = table.number_or_nan(row, "rotation_error_deg");
  if (std::isfinite(rotation_deg)) sums.rotation_error_deg.push_back(rotation_deg);
  constexpr std::array<const char*, 6> kFinal = {
      "final_rx_deg", "final_ry_deg", "final_rz_deg", "final_tx_mm", "final_ty_mm", "final_tz_mm"};
  for (std::size_t i = 0; i < kFinal.size(); ++i)
    sums.parameters[static_cast<Eigen::Index>(i)] += table.number(row, kFinal[i]);
}

void name_method(const EvaluationRun& run, MethodRow& row) {
  row.method = row.renderer;
  if (row.renderer != "field" && row.renderer != "raycast") return;
  const json method = run.summary.value("method", json::object());
  row.preset = method.value("preset", "?");
  row.similarity = method.value("similarity", "?");
  row.optimizer = method.value("optimizer", "?");
  row.method = row.preset + " " + row.similarity + " " + row.optimizer;
  if (row.renderer == "field" && method.value("corrected", false)) row.method += " corrected";
}

/// The case's own capture range of a run's summary.
std::string capture_range_of(const EvaluationRun& run,
                             const std::string& case_name,
                             const std::string& renderer) {
  for (const json& of_renderer : run.summary.value("renderers", json::array())) {
    if (of_renderer.value("renderer", "") != renderer) continue;
    for (const json& of_case : of_renderer.value("cases", json::array())) {
      const json range = of_case.value("capture_range", json());
      // Without what ended it, it is the cumulative range of an earlier version.
      if (of_case.value("case", "") != case_name || !range.is_object() ||
          !range.contains("ended_by"))
        continue;
      return (range.at("is_whole_study").get<bool>() ? "at least " : "") +
             fixed_text(range.at("initial_tre_mm").get<double>(), 0);
    }
  }
  return "-";
}

MethodRow row_of(const EvaluationRun& run,
                 const std::string& case_name,
                 const std::string& renderer,
                 const Sums& sums) {
  MethodRow row;
  row.run = run.folder.filename().string();
  row.case_name = case_name;
  row.renderer = renderer;
  name_method(run, row);
  row.starts = sums.starts;
  for (std::size_t band = 0; band < kBands; ++band) {
    row.bands.push_back(sums.bands[band]);
    row.bands[band].low_mm = kBandEndsMm[band];
    row.bands[band].high_mm = kBandEndsMm[band + 1];
    row.bands[band].wilson = wilson_interval(sums.bands[band].successes, sums.bands[band].trials);
    row.rotation_shares.push_back(sums.rotation_share[band] /
                                  static_cast<double>(sums.bands[band].trials));
  }
  // NaN without a success: 0 / 0.
  const auto successes = static_cast<double>(sums.tre_mm.size());
  const SampleSummary tre = summarize(sums.tre_mm);
  row.mean_tre_mm = tre.mean;
  row.median_tre_mm = tre.median;
  row.rotation_bias_deg = sums.parameters.head<3>().norm() / successes;
  row.translation_bias_mm = sums.parameters.tail<3>().norm() / successes;
  row.median_rotation_error_deg = summarize(sums.rotation_error_deg).median;
  row.mrpd_successes = static_cast<std::int64_t>(sums.mrpd_mm.size());
  row.median_mrpd_mm = summarize(sums.mrpd_mm).median;
  row.gross_failures = sums.gross_failures;
  row.capture_range_mm = capture_range_of(run, case_name, renderer);
  row.median_drr_count = summarize(sums.drr_counts).median;
  row.median_seconds = summarize(sums.seconds).median;
  return row;
}

}  // namespace

std::vector<MethodRow> method_rows(const std::vector<EvaluationRun>& runs) {
  std::vector<MethodRow> rows;
  for (const EvaluationRun& run : runs) {
    const RunFacts facts = facts_of(run);
    std::map<std::pair<std::string, std::string>, Sums> sums;
    run.read_registrations([&](const CsvTable& table) {
      for (std::size_t i = 0; i < table.row_count(); ++i)
        add_row(table, i, facts, sums[{table.text(i, "case"), table.text(i, "renderer")}]);
    });
    for (const auto& [key, value] : sums) rows.push_back(row_of(run, key.first, key.second, value));
  }
  return rows;
}

CsvTable methods_table(const std::vector<MethodRow>& rows) {
  std::vector<std::string> columns = {
      "run", "case", "method", "preset", "similarity", "optimizer", "renderer", "starts"};
  for (std::size_t band = 0; band < kBands; ++band) {
    const std::string name =
        fixed_text(kBandEndsMm[band], 0) + "_" + fixed_text(kBandEndsMm[band + 1], 0) + "_mm";
    for (const char* what :
         {"starts_", "successes_", "wilson_low_", "wilson_high_", "rotation_share_"})
      columns.push_back(what + name);
  }
  for (const char* name : {"mean_tre_mm",
                           "median_tre_mm",
                           "rotation_bias_deg",
                           "translation_bias_mm",
                           "median_rotation_error_deg",
                           "gross_failures",
                           "mrpd_successes",
                           "median_mrpd_mm",
                           "capture_range_mm",
                           "median_drr_count",
                           "median_seconds"})
    columns.emplace_back(name);
  CsvTable table(columns);
  for (const MethodRow& row : rows) {
    std::vector<std::string> fields = {row.run,
                                       row.case_name,
                                       row.method,
                                       row.preset,
                                       row.similarity,
                                       row.optimizer,
                                       row.renderer,
                                       std::to_string(row.starts)};
    for (std::size_t i = 0; i < row.bands.size(); ++i) {
      const IntervalSuccess& band = row.bands[i];
      fields.push_back(std::to_string(band.trials));
      fields.push_back(std::to_string(band.successes));
      fields.push_back(number_text(band.wilson.low));
      fields.push_back(number_text(band.wilson.high));
      fields.push_back(number_text(row.rotation_shares.at(i)));
    }
    for (const double value : {row.mean_tre_mm,
                               row.median_tre_mm,
                               row.rotation_bias_deg,
                               row.translation_bias_mm,
                               row.median_rotation_error_deg})
      fields.push_back(number_text(value));
    fields.push_back(std::to_string(row.gross_failures));
    fields.push_back(std::to_string(row.mrpd_successes));
    fields.push_back(number_text(row.median_mrpd_mm));
    fields.push_back(row.capture_range_mm);
    fields.push_back(number_text(row.median_drr_count));
    fields.push_back(number_text(row.median_seconds));
    table.add_row(std::move(fields));
  }
  return table;
}

namespace {

std::string claim_text(const json& ends) {
  const json& is_equivalent = ends.at("is_equivalent");
  if (is_equivalent.is_null())
    return "not claimed: fewer than " + ends.at("cases_needed").dump() + " patients";
  return is_equivalent.get<bool>() ? "yes" : "not shown";
}

}  // namespace

CsvTable pairs_table(const std::vector<EvaluationRun>& runs) try {
  CsvTable table({"run",
                  "common_starts",
                  "successes_field",
                  "successes_raycast",
                  "pairs",
                  "patients",
                  "mean_distance_mm",
                  "bootstrap_low_mm",
                  "bootstrap_high_mm",
                  "student_low_mm",
                  "student_high_mm",
                  "p95_distance_mm",
                  "max_distance_mm",
                  "margin_mm",
                  "claim",
                  "p",
                  "tre_difference_mm",
                  "mcnemar_p",
                  "median_seconds_field",
                  "median_seconds_raycast"});
  for (const EvaluationRun& run : runs) {
    const json pairs = run.summary.value("field_against_raycast", json());
    if (!pairs.is_object() || !pairs.contains("test")) continue;
    const auto number = [](const json& value) { return number_text(number_of(value)); };
    const json& ends = pairs.at("end_distance_mm");
    const json& over = ends.at("over_cases");
    table.add_row({run.folder.filename().string(),
                   pairs.at("common_starts").dump(),
                   pairs.at("successes").at(0).dump(),
                   pairs.at("successes").at(1).dump(),
                   pairs.at("pairs").dump(),
                   over.at("cases").dump(),
                   number(over.at("mean")),
                   number(over.at("low")),
                   number(over.at("high")),
                   number(over.at("student_low")),
                   number(over.at("student_high")),
                   number(ends.at("pairs").at("p95")),
                   number(ends.at("pairs").at("max")),
                   number(ends.at("margin_mm")),
                   claim_text(ends),
                   number(ends.at("p")),
                   number(pairs.at("test").at("mean_difference_mm")),
                   number(pairs.at("mcnemar_p")),
                   number(pairs.at("median_seconds").at(0)),
                   number(pairs.at("median_seconds").at(1))});
  }
  return table;
} catch (const json::exception&) {
  throw FileError(
      "summary.json", "field_against_raycast", "counts and distances", "something else");
}

}  // namespace af::evaluation
