// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "base/described_fields.h"
#include "cli/sub_command.h"

namespace af::evaluation {

/// `af-evaluate error-budget` as typed.
struct ErrorBudgetOptions {
  std::vector<std::string> steps;  ///< each as LABEL=RUN, in the order of the chain
  std::filesystem::path output_folder;

  void describe(Fields& field);
};

/// Collective. Tells how far each change in a chain of finished registration runs of one case moves
/// the mean end, beside the optimiser's scatter and the gold standard's own uncertainty. Prints
/// error-budget.md and writes it, error-budget.csv, summary.json and reproduce.sh. Throws
/// InputError for runs of several cases or methods, or from other starts.
cli::SubCommand error_budget_command(CLI::App& app);

}  // namespace af::evaluation
