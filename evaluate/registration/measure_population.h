// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "base/described_fields.h"
#include "cli/sub_command.h"

namespace af::evaluation {

/// `af-evaluate population` as typed.
struct PopulationOptions {
  std::vector<std::string> conditions;  ///< each as NAME=FOLDER
  std::uint64_t seed = 1;
  std::filesystem::path output = "population";

  void describe(Fields& field);
};

/// Rank 0. Measures the success of finished registration runs of many patients, with intervals over
/// patients. Writes population.csv (conditions and groups of patients), patients.csv and
/// intervals.csv, from which af-report makes population.md and the figures success.svg and
/// capture-range.svg. Throws InputError when runs of one study differ in their intervals or
/// threshold, or a condition holds no run.
cli::SubCommand population_command(CLI::App& app);

}  // namespace af::evaluation
