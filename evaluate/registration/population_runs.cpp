// SPDX-License-Identifier: Apache-2.0
#include "evaluate/registration/population_runs.h"

#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <utility>

#include "base/error.h"
#include "evaluate/registration/finished_rows.h"
#include "evaluate/statistics/patient_names.h"

namespace af::evaluation {

namespace {

using PatientsByRenderer = std::map<std::string, std::map<std::string, PatientOutcomes>>;

/// The run that has a case by a renderer. Without this check, a copy of a run would count its
/// starts twice.
using RunOfCase = std::map<std::pair<std::string, std::string>, std::filesystem::path>;

void add_population_row(const RegistrationRow& row,
                        const std::filesystem::path& run,
                        double success_mm,
                        RunOfCase& run_of_case,
                        PatientsByRenderer& found) {
  const auto [known, is_new] = run_of_case.emplace(std::pair(row.renderer, row.case_name), run);
  if (!is_new && known->second != run)
    throw InputError(
        "--condition",
        run.string(),
        "must not have case " + row.case_name + ", which " + known->second.string() + " has, too");
  const std::string patient = patient_of_case(row.case_name);
  PatientOutcomes& outcomes = found[row.renderer][patient];
  outcomes.patient = patient;
  outcomes.outcomes.push_back({row.initial_tre_mm, row.decisive_mm()});
  if (row.has_one_view && row.is_success(success_mm))
    outcomes.depth_mm.push_back(row.errors.depth_mm);
  outcomes.seconds.push_back(row.seconds);
}

/// The intervals and the threshold, which all runs must share.
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

std::string commit_of(const EvaluationRun& run) {
  try {
    return run.summary.at("provenance").at("program_commit").get<std::string>();
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
  std::set<std::string> errors;
  std::set<std::string> commits;
  RunOfCase run_of_case;
  for (const EvaluationRun& run : find_runs({condition.substr(equals + 1)})) {
    check_counting(run);
    commits.insert(commit_of(run));
    const RunFacts facts = facts_of(run);
    read_rows(run, facts, [&](const RegistrationRow& row) {
      errors.insert(row.decisive_name());
      add_population_row(row, run.folder, facts.success_tre_mm, run_of_case, found);
    });
  }
  if (found.empty())
    throw InputError("--condition", condition, "holds no finished registration run");
  for (auto& [renderer, patients] : found) {
    PopulationCondition one{condition.substr(0, equals), {}, errors, commits};
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
