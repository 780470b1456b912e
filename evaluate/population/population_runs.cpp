// SPDX-License-Identifier: Apache-2.0
#include "evaluate/population/population_runs.h"

#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <utility>

#include "base/error.h"
#include "evaluate/statistics/patient_names.h"
#include "text/csv_table.h"

namespace af::evaluation {

namespace {

using PatientsByRenderer = std::map<std::string, std::map<std::string, PatientOutcomes>>;

/// Which run has a case by a renderer: a copy of a run would count its starts twice.
using RunOfCase = std::map<std::pair<std::string, std::string>, std::filesystem::path>;

void add_population_rows(const CsvTable& table,
                         const std::filesystem::path& run,
                         RunOfCase& run_of_case,
                         PatientsByRenderer& found) {
  for (std::size_t row = 0; row < table.row_count(); ++row) {
    const std::string& case_name = table.text(row, "case");
    const std::string& renderer = table.text(row, "renderer");
    const auto [known, is_new] = run_of_case.emplace(std::pair(renderer, case_name), run);
    if (!is_new && known->second != run)
      throw InputError(
          "--condition",
          run.string(),
          "must not have case " + case_name + ", which " + known->second.string() + " has, too");
    const std::string patient = patient_of_case(case_name);
    PatientOutcomes& outcomes = found[renderer][patient];
    outcomes.patient = patient;
    const double initial_mm = table.number(row, "initial_tre_mm");
    outcomes.by_tre.push_back({initial_mm, table.number_or_nan(row, "tre_mm")});
    outcomes.by_mrpd.push_back({initial_mm, table.number_or_nan(row, "mrpd_mm")});
    outcomes.seconds.push_back(table.number_or_nan(row, "seconds"));
  }
}

/// Intervals and threshold, which all runs must share.
PopulationCounting counting_of(const EvaluationRun& run, std::uint64_t seed) {
  try {
    const nlohmann::json& intervals = run.summary.at("renderers").at(0).at("intervals");
    return {static_cast<int>(intervals.size()),
            intervals.at(0).at("high_mm").get<double>(),
            run.summary.at("success_tre_mm").get<double>(),
            seed};
  } catch (const nlohmann::json::exception&) {
    throw FileError((run.folder / "summary.json").string(),
                    "renderers",
                    "intervals of initial TRE, and success_tre_mm",
                    "something else");
  }
}

/// Runs of earlier versions do not say.
std::string commit_of(const EvaluationRun& run) {
  try {
    return run.summary.value("provenance", nlohmann::json::object())
        .value("program_commit", "unknown");
  } catch (const nlohmann::json::exception&) {
    throw FileError((run.folder / "summary.json").string(),
                    "provenance",
                    "program_commit, a text",
                    "something else");
  }
}

}  // namespace

void PopulationReader::read(const std::string& condition) {
  const std::size_t equals = condition.find('=');
  if (equals == 0 || equals == std::string::npos)
    throw InputError("--condition", condition, "must be NAME=FOLDER");
  PatientsByRenderer found;
  std::set<std::string> commits;
  RunOfCase run_of_case;
  for (const EvaluationRun& run : find_runs({condition.substr(equals + 1)})) {
    check_counting(run);
    commits.insert(commit_of(run));
    run.read_registrations(
        [&](const CsvTable& part) { add_population_rows(part, run.folder, run_of_case, found); });
  }
  if (found.empty())
    throw InputError("--condition", condition, "holds no finished registration run");
  for (auto& [renderer, patients] : found) {
    PopulationCondition one{condition.substr(0, equals), {}, commits};
    if (found.size() > 1) one.name += ", " + renderer;
    for (auto& [name, outcomes] : patients) one.patients.push_back(std::move(outcomes));
    conditions_.push_back(std::move(one));
  }
}

void PopulationReader::check_counting(const EvaluationRun& run) {
  const PopulationCounting counting = counting_of(run, seed_);
  if (!counting_) counting_ = counting;
  if (counting.intervals != counting_->intervals ||
      counting.interval_width_mm != counting_->interval_width_mm ||
      counting.success_mm != counting_->success_mm)
    throw InputError("--condition",
                     run.folder.string(),
                     "must have the intervals and the success threshold of the other runs");
}

}  // namespace af::evaluation
