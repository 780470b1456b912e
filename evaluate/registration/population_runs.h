// SPDX-License-Identifier: Apache-2.0
// The patients of finished registration runs.
#pragma once

#include <cstdint>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "evaluate/registration/population_statistics.h"
#include "evaluate/report/evaluation_run.h"

namespace af::evaluation {

/// The patients of one condition (clean or stressed, views, preset) by one renderer.
struct PopulationCondition {
  std::string name;
  std::vector<PatientOutcomes> patients;
  std::set<std::string> errors = {};   ///< RegistrationRow::decisive_name()
  std::set<std::string> commits = {};  ///< of the programs that made the runs
};

/// Collects the conditions of a study of many patients.
class PopulationReader {
 public:
  /// \param seed for the bootstrap, passed on by counting()
  explicit PopulationReader(std::uint64_t seed) : seed_(seed) {}

  /// Adds NAME=FOLDER: all registration runs below the folder, one condition per renderer. Throws
  /// InputError when the text has another form, when nothing is found, when two runs have the same
  /// case by one renderer, or when a run counts in other intervals or by another threshold than
  /// those before it. Throws FileError for a broken run.
  void read(const std::string& condition);

  [[nodiscard]] const std::vector<PopulationCondition>& conditions() const { return conditions_; }
  /// The counting that all runs share; valid after read().
  [[nodiscard]] const PopulationCounting& counting() const { return *counting_; }

 private:
  void check_counting(const EvaluationRun& run);

  std::uint64_t seed_;
  std::optional<PopulationCounting> counting_;
  std::vector<PopulationCondition> conditions_;
};

}  // namespace af::evaluation
