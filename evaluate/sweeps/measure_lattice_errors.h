// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "cli/sub_command.h"
#include "evaluate/registration/evaluated_methods.h"

namespace af::evaluation {

/// `af-evaluate lattice-errors` as typed.
struct LatticeErrorsOptions : MethodOptions {
  std::string case_name;  ///< empty for the study's only one
  int fractions = 4;
  std::filesystem::path output = "lattice-errors.md";

  void describe(Fields& field);
};

std::vector<std::string> problems(const LatticeErrorsOptions& options);

/// Collective. Tells whether ends of registrations depend on where in the cells of the fields the
/// true pose lies. Makes X-rays by ray casting at poses that step through a cell, so that the
/// fields are the only error, and registers each from the same start beside it. Writes a table of
/// amplitudes (Markdown) and the errors of all poses (CSV beside it). Rank 0 does the work.
cli::SubCommand lattice_errors_command(CLI::App& app);

}  // namespace af::evaluation
