// SPDX-License-Identifier: Apache-2.0
#include "evaluate/registration/method_comparison.h"

#include <array>
#include <cmath>
#include <iterator>
#include <map>
#include <set>
#include <utility>

#include <Eigen/Core>

#include "base/error.h"
#include "base/joined.h"
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

std::string percent_text(const IntervalSuccess& band) {
  if (band.trials == 0) return "-";
  // Whole per cents must not round a failure away.
  const double percent = 100 * band.rate();
  const bool would_mislead = percent < 100 && percent >= 99.5;
  return fixed_text(percent, would_mislead ? 1 : 0);
}

std::string wilson_text(const IntervalSuccess& band) {
  if (band.trials == 0) return "";
  return " [" + fixed_text(100 * band.wilson.low, 0) + ", " +
         fixed_text(100 * band.wilson.high, 0) + "]";
}

std::string p_text(double p) {
  return p < 0.0001 ? "< 0.0001" : fixed_text(p, 4);
}

std::string number_or_dash(double value, int decimals) {
  return std::isfinite(value) ? fixed_text(value, decimals) : "-";
}

/// A table of cells by line (several keys) and column.
struct CrossTable {
  std::vector<std::string> key_names;
  std::map<std::vector<std::string>, std::map<std::string, std::string>> lines;
  std::set<std::string> columns;

  void set(const std::vector<std::string>& keys, const std::string& column, std::string cell) {
    columns.insert(column);
    lines[keys][column] = std::move(cell);
  }

  [[nodiscard]] std::string markdown() const {
    std::string text = "|";
    for (const std::string& name : key_names) text += " " + name + " |";
    for (const std::string& column : columns) text += " " + column + " |";
    text += "\n|";
    for (std::size_t i = 0; i < key_names.size() + columns.size(); ++i) text += "---|";
    for (const auto& [keys, cells] : lines) {
      text += "\n|";
      for (const std::string& key : keys) text += " " + key + " |";
      for (const std::string& column : columns) {
        const auto cell = cells.find(column);
        text += " " + (cell == cells.end() ? std::string() : cell->second) + " |";
      }
    }
    return text + "\n";
  }
};

}  // namespace

std::vector<MethodRow> method_rows(const std::vector<EvaluationRun>& runs) {
  std::vector<MethodRow> rows;
  for (const EvaluationRun& run : runs) {
    if (run.kind != "registration") continue;
    const RunFacts facts = facts_of(run);
    std::map<std::pair<std::string, std::string>, Sums> sums;
    run.read_in_parts("registrations.csv", [&](const CsvTable& table) {
      for (std::size_t i = 0; i < table.row_count(); ++i)
        add_row(table, i, facts, sums[{table.text(i, "case"), table.text(i, "renderer")}]);
    });
    for (const auto& [key, value] : sums) rows.push_back(row_of(run, key.first, key.second, value));
  }
  return rows;
}

CsvTable methods_table(const std::vector<MethodRow>& rows) {
  std::vector<std::string> columns = {"run", "case", "method", "renderer", "starts"};
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
    std::vector<std::string> fields = {
        row.run, row.case_name, row.method, row.renderer, std::to_string(row.starts)};
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

std::string methods_markdown(const std::vector<MethodRow>& rows) {
  std::string text = "| Run | Case | Method | Renderer | Success % [95 % interval], starts ";
  for (std::size_t band = 0; band < kBands; ++band)
    text += (band == 0 ? "" : " / ") + fixed_text(kBandEndsMm[band], 0) + "-" +
            fixed_text(kBandEndsMm[band + 1], 0);
  text +=
      " mm | of starts | of whose size is rotation | Capture range, mm | Gross failures | TRE of "
      "successes, mm: mean, median | Right by mRPD: starts, median mm | Bias, deg and mm | DRRs | "
      "Seconds |\n"
      "|---|---|---|---|---|---|---|---|---|---|---|---|---|---|\n";
  for (const MethodRow& row : rows) {
    const std::vector<std::string> cells = {
        "| " + row.run,
        row.case_name,
        row.method,
        row.renderer,
        joined(row.bands,
               " / ",
               [](const IntervalSuccess& band) { return percent_text(band) + wilson_text(band); }),
        joined(row.bands,
               " / ",
               [](const IntervalSuccess& band) { return std::to_string(band.trials); }),
        joined(row.rotation_shares, " / ", [](double share) { return number_or_dash(share, 2); }),
        row.capture_range_mm,
        std::to_string(row.gross_failures),
        number_or_dash(row.mean_tre_mm, 3) + ", " + number_or_dash(row.median_tre_mm, 3),
        std::to_string(row.mrpd_successes) + " of " + std::to_string(row.starts) + ", " +
            number_or_dash(row.median_mrpd_mm, 3),
        number_or_dash(row.rotation_bias_deg, 3) + ", " +
            number_or_dash(row.translation_bias_mm, 3),
        number_or_dash(row.median_drr_count, 0),
        number_or_dash(row.median_seconds, 4)};
    text.append(joined(cells, " | ")).append(" |\n");
  }
  return text;
}

std::string screen_markdown(const std::vector<MethodRow>& rows) {
  CrossTable table{{"Case", "Renderer", "Preset", "Measure"}, {}, {}};
  for (const MethodRow& row : rows)
    table.set({row.case_name, row.renderer, row.preset, row.similarity},
              row.optimizer,
              percent_text(row.bands[0]) + " / " + percent_text(row.bands[1]) + ", " +
                  number_or_dash(row.median_tre_mm, 3));
  return table.markdown();
}

std::string studies_markdown(const std::vector<MethodRow>& rows) {
  CrossTable table{{"Study", "Renderer"}, {}, {}};
  for (const MethodRow& row : rows) {
    const std::size_t end = row.run.rfind("-" + row.preset);
    if (row.preset.empty() || end == std::string::npos) continue;
    std::string percents;
    for (const IntervalSuccess& band : row.bands)
      percents += (percents.empty() ? "" : " / ") + percent_text(band);
    table.set({row.run.substr(0, end), row.renderer},
              row.run.substr(end + 1),
              percents + ", " + number_or_dash(row.median_tre_mm, 3) + ", " +
                  number_or_dash(1000.0 * row.median_seconds, 1));
  }
  return table.columns.size() < 2 ? std::string() : table.markdown();
}

namespace {

/// "0.021 [0.018, 0.024]" by bootstrap, and Student's interval behind it.
std::string over_patients_text(const json& over) {
  const auto number = [&](const char* name) { return number_or_dash(number_of(over[name]), 3); };
  return number("mean") + " [" + number("low") + ", " + number("high") + "], Student [" +
         number("student_low") + ", " + number("student_high") + "]";
}

std::string claim_text(const json& ends) {
  const json& is_equivalent = ends["is_equivalent"];
  if (is_equivalent.is_null())
    return "not claimed: fewer than " + ends["cases_needed"].dump() + " patients";
  return std::string(is_equivalent.get<bool>() ? "yes" : "not shown") + ", p " +
         p_text(number_of(ends["p"]));
}

}  // namespace

std::string pairs_markdown(const std::vector<EvaluationRun>& runs) {
  std::string text;
  for (const EvaluationRun& run : runs) {
    const json pairs = run.summary.value("field_against_raycast", json());
    if (!pairs.is_object() || !pairs.contains("test")) continue;
    const json& test = pairs["test"];
    const auto number = [&](const char* name, int decimals) {
      return number_or_dash(number_of(test[name]), decimals);
    };
    // Runs of earlier versions have no distances.
    const json ends = pairs.value("end_distance_mm", json());
    text += "| " + run.folder.filename().string() + " | " + pairs["common_starts"].dump() + " | " +
            pairs["successes"][0].dump() + ", " + pairs["successes"][1].dump() + " | " +
            number_or_dash(number_of(pairs["mcnemar_p"]), 2) + " | " + pairs["pairs"].dump() +
            " | ";
    if (ends.is_object())
      text += ends["over_cases"]["cases"].dump() + " | " + over_patients_text(ends["over_cases"]) +
              " | " + number_or_dash(number_of(ends["pairs"]["p95"]), 3) + ", " +
              number_or_dash(number_of(ends["pairs"]["max"]), 3) + " | " +
              number_or_dash(number_of(ends["margin_mm"]), 2) + " mm: " + claim_text(ends) + " | ";
    else
      text += "- | - | - | - | ";
    text += number("mean_difference_mm", 3) + " [" + number("low_90_mm", 3) + ", " +
            number("high_90_mm", 3) + "] | " +
            number_or_dash(number_of(pairs["median_seconds"][0]), 4) + ", " +
            number_or_dash(number_of(pairs["median_seconds"][1]), 2) + " |\n";
  }
  if (text.empty()) return text;
  return "| Run | Common starts | Successes: field, ray casting | McNemar p | Pairs | Patients | "
         "End poses apart, mm: mean over patients [95 % intervals] | of pairs: 95th percentile, "
         "largest | Equivalent within | TRE, field less ray casting, mm [90 % interval, starts as "
         "if independent] | Seconds |\n"
         "|---|---|---|---|---|---|---|---|---|---|---|\n" +
         text;
}

}  // namespace af::evaluation
