// SPDX-License-Identifier: Apache-2.0
#include "evaluate/sweeps/make_error_budget.h"

#include <iostream>
#include <sstream>

#include "base/error.h"
#include "evaluate/registration/finished_rows.h"
#include "evaluate/report/report_program.h"
#include "evaluate/report/sample_summary_json.h"
#include "evaluate/statistics/success_rate.h"
#include "evaluate/sweeps/error_budget.h"
#include "files/csv_cells.h"
#include "files/options_toml.h"
#include "files/output_file.h"
#include "files/sha256.h"
#include "geometry/target_box.h"
#include "ranks/provenance.h"
#include "ranks/root_only.h"
#include "study/case_gold_standard.h"
#include "study/study_file.h"

namespace af::evaluation {
namespace {

using nlohmann::json;

/// A run of the chain, read from its folder.
struct ChainRun {
  EvaluationRun files;
  std::string starts_text;
  BudgetRun budget;
};

ChainRun read_run(const std::string& step) {
  const std::size_t equals = step.find('=');
  if (equals == std::string::npos || equals == 0)
    throw InputError("--step", step, "must be LABEL=RUN");
  const std::vector<EvaluationRun> found = find_runs({step.substr(equals + 1)});
  if (found.size() != 1)
    throw InputError("--step", step, "must name the folder of one finished registration run");
  const EvaluationRun& files = found.front();
  if (files.summary.at("cases").size() != 1 || files.summary.at("renderers").size() != 1)
    throw InputError("--step", step, "must be of one case and one renderer");
  const RunFacts facts = facts_of(files);
  BudgetRun budget = {step.substr(0, equals), {}};
  read_rows(files, facts, [&](const RegistrationRow& row) {
    budget.ends.push_back(row.is_success(facts.success_tre_mm)
                              ? std::optional(PoseParameters::from_deg_and_mm(row.final_deg_mm))
                              : std::nullopt);
  });
  return {files, read_text_file(files.folder / "starts.csv"), budget};
}

/// Starts are poses, so equal starts also mean the same case and gold pose.
void require_same_starts(const std::vector<ChainRun>& runs) {
  for (const ChainRun& run : runs)
    if (run.starts_text != runs.front().starts_text)
      throw InputError(
          "--step",
          run.budget.label,
          "must be from the same starts and gold pose as the first run; the starts.csv "
          "differ",
          run.files.folder.string());
}

ErrorBudget budget_of(const std::vector<ChainRun>& runs) {
  const Study study = read_study(runs.front().files.summary.at("study").get<std::string>());
  const json& of_case = runs.front().files.summary.at("cases").front();
  const StudyCase& study_case = study.find_case(of_case.at("case").get<std::string>());
  const GoldStandard gold =
      gold_standard(study, study_case, of_case.at("gold").at("source").get<std::string>());
  std::vector<BudgetRun> budget_runs;
  budget_runs.reserve(runs.size());
  for (const ChainRun& run : runs) budget_runs.push_back(run.budget);
  return error_budget(budget_runs,
                      PoseFrame::about(gold.room_from_ct, study_case.center_ct_mm),
                      target_points(study_case.target_box_ct));
}

json step_json(const BudgetStep& step) {
  return {{"label", step.label},
          {"starts", step.starts},
          {"successes", step.successes},
          {"shift_mm", number_json(step.shift_mm)},
          {"shift_standard_error_mm", number_json(step.shift_standard_error_mm)},
          {"bias_mm", step.bias_mm},
          {"scatter_mm", step.scatter_mm},
          {"tre_mm", step.tre_mm},
          {"mean_end_deg_mm", step.mean_end.deg_and_mm()}};
}

CsvTable budget_table(const ErrorBudget& budget) {
  return csv_table(budget.steps, [](const BudgetStep& step) {
    CsvCells cells = {{"step", step.label},
                      {"starts", step.starts},
                      {"successes", step.successes},
                      {"shift_mm", step.shift_mm},
                      {"shift_standard_error_mm", step.shift_standard_error_mm},
                      {"bias_mm", step.bias_mm},
                      {"scatter_mm", step.scatter_mm},
                      {"tre_mm", step.tre_mm}};
    append("mean_", kParameterNames, step.mean_end.deg_and_mm(), cells);
    return cells;
  });
}

/// The gold standard's own error, from the chain's last run that has fiducials.
json gold_of(const std::vector<ChainRun>& runs) {
  json result;
  for (const ChainRun& run : runs) {
    const json& gold = run.files.summary.at("cases").front().at("gold");
    if (gold.contains("uncertainty")) result = gold;
  }
  return result;
}

json summary_json(const std::vector<ChainRun>& runs, const ErrorBudget& budget) {
  json summary = summary_of_kind("error-budget");
  summary["case"] = runs.front().files.summary.at("cases").front().at("case");
  summary["method"] = runs.back().files.summary.at("method");
  summary["common_starts"] = budget.common_starts;
  summary["gold"] = gold_of(runs);
  for (const BudgetStep& step : budget.steps) summary["steps"].push_back(step_json(step));
  return summary;
}

}  // namespace

void ErrorBudgetOptions::describe(Fields& field) {
  field("step",
        steps,
        "LABEL=RUN: a run's folder and what is different from the run before; in order")
      .required();
  field("output", output_folder, "Folder for the results").as("-o,--output").required();
}

namespace {

void run_error_budget(const ErrorBudgetOptions& options,
                      const std::string& command_line,
                      const Communicator& world) {
  do_on_root(world, [&] {
    announce_outputs(options.output_folder,
                     {"error-budget.md", "error-budget.csv", "reproduce.sh", "summary.json"});
    std::vector<ChainRun> runs;
    Provenance provenance = {
        "af-evaluate error-budget", command_line, to_toml(options), 0, world.size(), {}};
    for (const std::string& step : options.steps) {
      runs.push_back(read_run(step));
      provenance.inputs[runs.back().budget.label] =
          sha256_of_file((runs.back().files.folder / "registrations.csv").string());
    }
    require_same_starts(runs);
    const ErrorBudget budget = budget_of(runs);
    const json summary = summary_json(runs, budget);
    const OutputLock lock = make_output_folder(options.output_folder);
    write_text_file(options.output_folder / "error-budget.csv", budget_table(budget).to_text());
    write_results_last(options.output_folder / "summary.json", summary, provenance);
    draw_results({options.output_folder.string()}, world);
    std::cout << "results: " << options.output_folder.string() << '\n';
  });
}

}  // namespace

cli::SubCommand error_budget_command(CLI::App& app) {
  return cli::sub_command(app,
                          "error-budget",
                          "What each part of the chain from CT to pose adds to the error, by runs "
                          "that differ in one thing (jobs/error-budget.sh)",
                          run_error_budget);
}

}  // namespace af::evaluation
