// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cstdint>

#include "base/error.h"
#include "base/joined.h"
#include "evaluate/outputs/result_figures.h"
#include "evaluate/outputs/sample_summary_json.h"
#include "evaluate/report/html_text.h"
#include "evaluate/report/number_html.h"
#include "evaluate/report/sections_report.h"
#include "files/output_file.h"
#include "text/csv_table.h"

namespace af::evaluation {

using nlohmann::json;

namespace {

/// The most methods for which the figure has colours.
constexpr std::size_t kMostCurves = 6;

std::string case_names(const json& summary) {
  constexpr std::size_t kMostNamed = 4;
  const json& cases = summary.at("cases");
  if (cases.size() > kMostNamed) return std::to_string(cases.size()) + " cases";
  return joined(
      cases, ", ", [](const json& entry) { return escaped(entry.at("case").get<std::string>()); });
}

/// The methods of our own renderers' runs; empty for another program's poses.
std::string search_text(const json& summary, const json& renderer) {
  const json method = summary.value("method", json::object());
  const std::string name = renderer.at("renderer").get<std::string>();
  std::string text;
  if (name == "field" || name == "raycast")
    for (const char* part : {"preset", "similarity", "optimizer"})
      if (const std::string value = method.value(part, ""); !value.empty())
        text += (text.empty() ? "" : ", ") + escaped(value);
  return text.empty() ? "–" : element("span", text, "search");
}

/// Of the patients' own capture ranges the mean, and the smallest; the range of all starts together
/// where there is one patient, or where an earlier version made the run.
std::string capture_cell(const json& renderer) {
  const json own = renderer.at("over_cases").value("capture_range_mm", json());
  if (!own.is_object() || own.at("cases").get<std::int64_t>() < 2)
    return capture_text(renderer.at("capture_range"));
  return std::string(own.at("at_least") == 0 ? "" : "≥ ") + decimals(own.at("mean_mm"), 1) + " (" +
         decimals(own.at("min_mm"), 0) + ")";
}

/// Runs of earlier versions counted gross failures by TRE alone.
const json& gross_failures_of(const json& summary, const json& renderer) {
  const bool by_mrpd = is_of_one_view(summary) && renderer.contains("mrpd_gross_failures");
  return renderer.at(by_mrpd ? "mrpd_gross_failures" : "gross_failures");
}

std::string success_cell(const json& summary, const json& renderer) {
  return is_of_one_view(summary) ? rate_with_interval(renderer.at("mrpd_success")) + " by mRPD"
                                 : rate_with_interval(renderer);
}

std::string comparison_table(const std::vector<const EvaluationRun*>& runs) {
  HtmlTable table({{"Run", false},
                   {"Cases", false},
                   {"Method", false},
                   {"Preset, similarity, search", false},
                   {"Starts", true},
                   {"Success (95 % interval)", true},
                   {"Median TRE of all (mm)", true},
                   {"95th percentile (mm)", true},
                   {"Mean TRE of successes (mm)", true},
                   {"Gross failures", true},
                   {"Capture range, mean over patients (smallest) (mm)", true},
                   {"Median time", true}},
                  "Every run and method; a click on a title sorts");
  for (const EvaluationRun* run : runs)
    for (const json& renderer : run->summary.at("renderers"))
      table.add_row({"<a href=\"#" + run_id(*run) + "\">" + escaped(run->name) + "</a>",
                     case_names(run->summary),
                     element("span", method_title(renderer), "nowrap"),
                     search_text(run->summary, renderer),
                     plain(renderer.at("starts")),
                     success_cell(run->summary, renderer),
                     decimals(renderer.at("tre_of_all_mm").at("median"), 2),
                     decimals(renderer.at("tre_of_all_mm").at("p95"), 2),
                     decimals(renderer.at("tre_of_successes_mm").at("mean"), 2),
                     plain(gross_failures_of(run->summary, renderer).at("successes")),
                     capture_cell(renderer),
                     seconds_text(number_of(renderer.at("seconds").at("median")))});
  return table.html();
}

/// Initial and final TRE of one renderer's rows.
std::vector<TreOutcome> outcomes_of_run(const EvaluationRun& run, const std::string& renderer) {
  std::vector<TreOutcome> outcomes;
  run.read_in_parts("registrations.csv", [&](const CsvTable& rows) {
    for (std::size_t i = 0; i < rows.row_count(); ++i) {
      if (rows.text(i, "renderer") != renderer) continue;
      outcomes.push_back({rows.number(i, "initial_tre_mm"), rows.number_or_nan(i, "tre_mm")});
    }
  });
  return outcomes;
}

/// Whether two runs divide initial TRE alike.
bool have_same_intervals(const EvaluationRun& a, const EvaluationRun& b) {
  const json& of_a = a.summary.at("renderers").at(0).at("intervals");
  const json& of_b = b.summary.at("renderers").at(0).at("intervals");
  return of_a.size() == of_b.size() && of_a.at(0).at("high_mm") == of_b.at(0).at("high_mm");
}

/// Success of the first method of each run; empty when the runs' intervals differ.
std::string success_figure(const std::vector<const EvaluationRun*>& runs,
                           const std::filesystem::path& figures) {
  std::vector<OutcomeGroup> groups;
  for (const EvaluationRun* run : runs) {
    if (!have_same_intervals(*runs.front(), *run)) return "";
    const std::string renderer =
        run->summary.at("renderers").at(0).at("renderer").get<std::string>();
    if (groups.size() < kMostCurves) groups.push_back({run->name, outcomes_of_run(*run, renderer)});
  }
  const json& intervals = runs.front()->summary.at("renderers").at(0).at("intervals");
  const double width_mm = intervals.at(0).at("high_mm").get<double>();
  constexpr double kMostMm = 1000;
  if (!(width_mm > 0.0 && width_mm <= kMostMm))
    throw FileError((runs.front()->folder / "summary.json").string(),
                    "high_mm of the first interval",
                    "above 0, at most 1000",
                    plain(intervals.at(0).at("high_mm")));
  const OutputLock lock = make_output_folder(figures);
  draw_success_rates(
      groups, static_cast<int>(intervals.size()), width_mm, figures / "success-of-runs");
  return report_figure(figures / "success-of-runs",
                       runs.front()->page_folder,
                       "Success rate of every run per interval of initial error",
                       "<b>Success against initial error</b>, the first method of " +
                           std::string(runs.size() > kMostCurves
                                           ? "the first " + std::to_string(kMostCurves) + " runs"
                                           : "each run") +
                           "; bars: 95 % Wilson intervals.",
                       "narrow");
}

}  // namespace

std::string comparison_section(const std::vector<EvaluationRun>& runs,
                               const std::filesystem::path& figures) {
  const auto registrations = runs_of(runs, "registration");
  if (registrations.size() < 2) return "";
  return section_heading("Runs side by side", "runs") + comparison_table(registrations) +
         success_figure(registrations, figures);
}

}  // namespace af::evaluation
