// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "base/error.h"
#include "evaluate/outputs/failed_start.h"
#include "evaluate/outputs/sample_summary_json.h"
#include "evaluate/report/html_text.h"
#include "evaluate/report/number_html.h"
#include "evaluate/report/run_report.h"
#include "evaluate/report/sections_report.h"
#include "evaluate/statistics/success_rate.h"
#include "text/csv_table.h"

namespace af::evaluation {

using nlohmann::json;

namespace {

constexpr std::int64_t kMostFailuresListed = 60;
constexpr double kSparkWidth = 150.0;
constexpr double kSparkHeight = 40.0;

struct SparkPoint {
  double poses_tried = 0.0;
  double tre_mm = 0.0;
};

std::int64_t start_index_of(const CsvTable& rows, std::size_t row) {
  const double index = rows.number(row, "start_index");
  constexpr double kMost = 1e15;  // far below where doubles skip whole numbers
  if (!(index >= 0.0 && index <= kMost) || index != std::floor(index))
    throw FileError(
        rows.where(row), "start_index", "a whole number", rows.text(row, "start_index"));
  return static_cast<std::int64_t>(index);
}

std::vector<SparkPoint> spark_points(const CsvTable& trace, double initial_tre_mm) {
  std::vector<SparkPoint> points = {{0.0, initial_tre_mm}};
  for (std::size_t i = 0; i < trace.row_count(); ++i) {
    const SparkPoint point = {trace.number(i, "poses_tried"), trace.number_or_nan(i, "tre_mm")};
    if (std::isfinite(point.tre_mm)) points.push_back(point);
  }
  return points;
}

/// Below which TRE a start of the run succeeds.
double success_tre_mm_of(const EvaluationRun& run) {
  return run.summary.at("success_tre_mm").get<double>();
}

/// TRE against the poses tried as a small line; a dashed line shows below which TRE a start
/// succeeds.
std::string spark(const std::vector<SparkPoint>& points, double success_tre_mm) {
  double highest_mm = 2 * success_tre_mm;
  for (const SparkPoint& point : points) highest_mm = std::max(highest_mm, point.tre_mm);
  const double poses = std::max(1.0, points.back().poses_tried);
  const auto height = [&](double tre_mm) {
    return decimals(kSparkHeight - 2 - (kSparkHeight - 4) * tre_mm / highest_mm, 1);
  };
  std::string line;
  for (const SparkPoint& point : points)
    line += (line.empty() ? "" : " ") + decimals(kSparkWidth * point.poses_tried / poses, 1) + "," +
            height(point.tre_mm);
  const std::string limit = height(success_tre_mm);
  const std::string text = "TRE from " + decimals(points.front().tre_mm, 1) + " to " +
                           decimals(points.back().tre_mm, 1) + " mm over " + decimals(poses, 0) +
                           " poses";
  const std::string size = decimals(kSparkWidth, 0) + " " + decimals(kSparkHeight, 0);
  return "<svg class=\"spark\" viewBox=\"0 0 " + size + "\" role=\"img\" aria-label=\"" + text +
         "\"><title>" + text + "</title><line x1=\"0\" x2=\"150\" y1=\"" + limit + "\" y2=\"" +
         limit + "\"/><polyline points=\"" + line + "\"/></svg>";
}

/// The search of a failure, as far as the run kept it.
std::string trace_cell(const EvaluationRun& run, const CsvTable& rows, std::size_t row) {
  const std::string file =
      trace_file(rows.text(row, "case"), rows.text(row, "renderer"), start_index_of(rows, row));
  if (!run.has_file(file)) return "–";
  const std::vector<SparkPoint> points =
      spark_points(run.table(file), rows.number(row, "initial_tre_mm"));
  return "<span class=\"nowrap\">" + spark(points, success_tre_mm_of(run)) + " <a href=\"" +
         run.link(file) + "\">trace</a></span>";
}

std::string repeat_cell(const EvaluationRun& run, const CsvTable& rows, std::size_t row) {
  const std::string command = repeat_command(
      run.summary, rows.text(row, "case"), rows.text(row, "renderer"), start_index_of(rows, row));
  if (command.empty()) return "–";
  return "<details><summary>command</summary><pre class=\"command\">" + escaped(command) +
         "</pre></details>";
}

void add_failure(const EvaluationRun& run,
                 const CsvTable& rows,
                 std::size_t row,
                 HtmlTable& table) {
  const std::string& error = rows.text(row, "error");
  table.add_row({escaped(rows.text(row, "case")),
                 method_title({{"renderer", rows.text(row, "renderer")}}),
                 escaped(rows.text(row, "start_index")),
                 decimals(rows.number(row, "initial_tre_mm"), 2),
                 decimals(number_json(rows.number_or_nan(row, "tre_mm")), 2),
                 escaped(error.empty() ? rows.text(row, "stop_reason") : error),
                 trace_cell(run, rows, row),
                 repeat_cell(run, rows, row)});
}

}  // namespace

std::string failures_text(const EvaluationRun& run) {
  HtmlTable table({{"Case", false},
                   {"Method", false},
                   {"Start", true},
                   {"Initial TRE (mm)", true},
                   {"Final TRE (mm)", true},
                   {"Stopped because", false},
                   {"TRE along the search", false},
                   {"Repeat it alone", false, false}},
                  "Failed starts: TRE against the poses tried, the dashed line at " +
                      decimals(success_tre_mm_of(run), 1) +
                      " mm; each can be repeated alone by its command");
  std::int64_t failures = 0;
  run.read_in_parts("registrations.csv", [&](const CsvTable& rows) {
    for (std::size_t i = 0; i < rows.row_count(); ++i)
      if (rows.text(i, "success") != "1" && ++failures <= kMostFailuresListed)
        add_failure(run, rows, i, table);
  });
  if (failures == 0) return element("p", "No registration failed.");
  const std::string rest = failures > kMostFailuresListed
                               ? "The first " + std::to_string(kMostFailuresListed) +
                                     " are listed; <a href=\"" + run.link("registrations.csv") +
                                     "\">registrations.csv</a> has all."
                               : "";
  return element("p",
                 "All " + counted(failures, "failure counts", "failures count") +
                     " in every rate above. " + rest) +
         table.html();
}

}  // namespace af::evaluation
