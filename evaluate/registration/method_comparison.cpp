// SPDX-License-Identifier: Apache-2.0
#include "evaluate/registration/method_comparison.h"

#include <array>
#include <cmath>
#include <iterator>
#include <map>
#include <set>
#include <utility>

#include <Eigen/Core>

#include "evaluate/outputs/sample_summary_json.h"
#include "evaluate/statistics/statistics.h"

namespace af::evaluation {

using nlohmann::json;

namespace {

constexpr std::size_t kBands = std::size(kBandEndsMm) - 1;

/// Registrations of one case by one renderer.
struct Sums {
  std::array<IntervalSuccess, kBands> bands{};
  Eigen::Matrix<double, 6, 1> parameters = Eigen::Matrix<double, 6, 1>::Zero();
  std::vector<double> tre_mm;  ///< of successes
  std::int64_t starts = 0;
  std::vector<double> drr_counts;
  std::vector<double> seconds;
};

void add_row(const CsvTable& table, std::size_t row, Sums& sums) {
  const double initial_mm = table.number(row, "initial_tre_mm");
  const double tre_mm = table.number_or_nan(row, "tre_mm");
  const bool is_success = tre_mm < kSuccessTreMm;
  ++sums.starts;
  for (std::size_t band = 0; band < kBands; ++band) {
    if (!(initial_mm >= kBandEndsMm[band] && initial_mm < kBandEndsMm[band + 1])) continue;
    ++sums.bands[band].trials;
    sums.bands[band].successes += is_success ? 1 : 0;
  }
  sums.drr_counts.push_back(table.number(row, "drr_count"));
  const double seconds = table.number_or_nan(row, "seconds");
  if (std::isfinite(seconds)) sums.seconds.push_back(seconds);
  if (!is_success) return;
  sums.tre_mm.push_back(tre_mm);
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
  }
  // NaN without a success: 0 / 0.
  const auto successes = static_cast<double>(sums.tre_mm.size());
  const SampleSummary tre = summarize(sums.tre_mm);
  row.mean_tre_mm = tre.mean;
  row.median_tre_mm = tre.median;
  row.rotation_bias_deg = sums.parameters.head<3>().norm() / successes;
  row.translation_bias_mm = sums.parameters.tail<3>().norm() / successes;
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
    std::map<std::pair<std::string, std::string>, Sums> sums;
    run.read_in_parts("registrations.csv", [&](const CsvTable& table) {
      for (std::size_t i = 0; i < table.row_count(); ++i)
        add_row(table, i, sums[{table.text(i, "case"), table.text(i, "renderer")}]);
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
    for (const char* what : {"starts_", "successes_", "wilson_low_", "wilson_high_"})
      columns.push_back(what + name);
  }
  for (const char* name : {"mean_tre_mm",
                           "median_tre_mm",
                           "rotation_bias_deg",
                           "translation_bias_mm",
                           "median_drr_count",
                           "median_seconds"})
    columns.emplace_back(name);
  CsvTable table(columns);
  for (const MethodRow& row : rows) {
    std::vector<std::string> fields = {
        row.run, row.case_name, row.method, row.renderer, std::to_string(row.starts)};
    for (const IntervalSuccess& band : row.bands) {
      fields.push_back(std::to_string(band.trials));
      fields.push_back(std::to_string(band.successes));
      fields.push_back(number_text(band.wilson.low));
      fields.push_back(number_text(band.wilson.high));
    }
    for (const double value : {row.mean_tre_mm,
                               row.median_tre_mm,
                               row.rotation_bias_deg,
                               row.translation_bias_mm,
                               row.median_drr_count,
                               row.median_seconds})
      fields.push_back(number_text(value));
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
      " mm | of starts | TRE of successes, mm: mean, median | Bias, deg and mm | DRRs | Seconds |\n"
      "|---|---|---|---|---|---|---|---|---|---|\n";
  for (const MethodRow& row : rows) {
    std::string percents;
    std::string counts;
    for (const IntervalSuccess& band : row.bands) {
      percents += (percents.empty() ? "" : " / ") + percent_text(band) + wilson_text(band);
      counts += (counts.empty() ? "" : " / ") + std::to_string(band.trials);
    }
    text += "| " + row.run + " | " + row.case_name + " | " + row.method + " | " + row.renderer +
            " | " + percents + " | " + counts + " | " + number_or_dash(row.mean_tre_mm, 3) + ", " +
            number_or_dash(row.median_tre_mm, 3) + " | " +
            number_or_dash(row.rotation_bias_deg, 3) + ", " +
            number_or_dash(row.translation_bias_mm, 3) + " | " +
            number_or_dash(row.median_drr_count, 0) + " | " +
            number_or_dash(row.median_seconds, 4) + " |\n";
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

std::string pairs_markdown(const std::vector<EvaluationRun>& runs) {
  std::string text;
  for (const EvaluationRun& run : runs) {
    const json pairs = run.summary.value("field_against_raycast", json());
    if (!pairs.is_object() || !pairs.contains("test")) continue;
    const json& test = pairs["test"];
    const auto number = [&](const char* name, int decimals) {
      return number_or_dash(number_of(test[name]), decimals);
    };
    text += "| " + run.folder.filename().string() + " | " + pairs["common_starts"].dump() + " | " +
            pairs["successes"][0].dump() + ", " + pairs["successes"][1].dump() + " | " +
            number_or_dash(number_of(pairs["mcnemar_p"]), 2) + " | " + pairs["pairs"].dump() +
            " | " + number("mean_difference_mm", 3) + " [" + number("low_90_mm", 3) + ", " +
            number("high_90_mm", 3) + "] | " + p_text(number_of(test["equivalence_p"])) + " at " +
            number("margin_mm", 2) + " mm | " + number("equivalence_power", 2) + " | " +
            number_or_dash(number_of(pairs["median_seconds"][0]), 4) + ", " +
            number_or_dash(number_of(pairs["median_seconds"][1]), 2) + " |\n";
  }
  if (text.empty()) return text;
  return "| Run | Common starts | Successes: field, ray casting | McNemar p | Pairs | TRE, field "
         "less "
         "ray casting, mm [90 % interval] | Equivalence p | Power | Seconds |\n"
         "|---|---|---|---|---|---|---|---|---|\n" +
         text;
}

}  // namespace af::evaluation
