// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "files/csv_table.h"

namespace af::evaluation {

/// What the summary.json of every kind of run begins with.
nlohmann::json summary_of_kind(const std::string& kind);

/// One finished registration run of af-evaluate, as its folder tells.
// nlohmann::json asserts in its move constructor.
// NOLINTNEXTLINE(bugprone-exception-escape)
struct EvaluationRun {
  std::filesystem::path folder;
  nlohmann::json summary;

  /// Reads registrations.csv, which may be of any length, in parts. FileError: it is missing, no
  /// CSV, or a link to elsewhere.
  void read_registrations(const std::function<void(const CsvTable& part)>& receive) const;
};

/// The finished registration runs in the given folders and the folders below them, by path; each
/// once. Repeats of single starts below a folder are left out. FileError: a folder does not exist,
/// or a summary.json is damaged or of another version. InputError: there is no run at all.
std::vector<EvaluationRun> find_runs(const std::vector<std::filesystem::path>& folders);

}  // namespace af::evaluation
