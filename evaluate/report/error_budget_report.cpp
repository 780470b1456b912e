// SPDX-License-Identifier: Apache-2.0
#include "evaluate/report/html_text.h"
#include "evaluate/report/number_html.h"
#include "evaluate/report/sections_report.h"

namespace af::evaluation {

using nlohmann::json;

namespace {

std::string budget_table(const json& summary) {
  HtmlTable table(
      {{"Run: what is different from the one before", false},
       {"Succeeded", true},
       {"Moves the mean end by (mm)", true},
       {"± standard error", true},
       {"Bias (mm)", true},
       {"Scatter (mm)", true},
       {"TRE (mm)", true}},
      "Mean TREs between poses. Bias: of the mean end from the gold pose; scatter: of an "
      "end from the mean end, which is the optimiser's");
  for (const json& step : summary.at("steps"))
    table.add_row({escaped(step.at("label").get<std::string>()),
                   plain(step.at("successes")) + " of " + plain(step.at("starts")),
                   decimals(step.at("shift_mm"), 3),
                   decimals(step.at("shift_standard_error_mm"), 3),
                   decimals(step.at("bias_mm"), 3),
                   decimals(step.at("scatter_mm"), 3),
                   decimals(step.at("tre_mm"), 3)});
  return table.html();
}

std::string gold_text(const json& gold) {
  if (!gold.is_object()) return "";
  const json& uncertainty = gold.at("uncertainty");
  return element(
      "p",
      "A gold pose by fiducials would itself lie " + decimals(uncertainty.at("mean_tre_mm"), 3) +
          " mm off on average (95th percentile " + decimals(uncertainty.at("p95_tre_mm"), 3) +
          " mm), by Monte Carlo on the fiducials' residuals; this one lies " +
          decimals(gold.value("stated_to_fiducials_mm", json()), 3) + " mm from the stated pose.");
}

}  // namespace

std::string error_budget_section(const std::vector<EvaluationRun>& runs) {
  std::string text;
  for (const EvaluationRun* run : runs_of(runs, "error-budget"))
    text += element("h3", "Case " + escaped(run->summary.at("case").get<std::string>())) +
            element("p",
                    "A chain of runs from the same starts, each different from the one before in "
                    "one thing, over the " +
                        plain(run->summary.at("common_starts")) +
                        " starts from which every run succeeded.") +
            budget_table(run->summary) + gold_text(run->summary.at("gold"));
  return text.empty() ? "" : section_heading("Error budget", "error-budget") + text;
}

}  // namespace af::evaluation
