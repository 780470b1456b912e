// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "files/csv_table.h"

namespace af::evaluation {

/// The beginning of the summary.json of every kind of run.
nlohmann::json summary_of_kind(const std::string& kind);

/// One finished registration run of af-evaluate, as found in its folder.
// nlohmann::json asserts in its move constructor.
// NOLINTNEXTLINE(bugprone-exception-escape)
struct EvaluationRun {
  std::filesystem::path folder;
  nlohmann::json summary;

  /// Reads registrations.csv, which may be of any length, in parts. Throws FileError when it is
  /// missing, no CSV, or a link to elsewhere.
  void read_registrations(const std::function<void(const CsvTable& part)>& receive) const;
};

/// The finished registration runs in the given folders and the folders below them, each once,
/// sorted by path. Repeats of single starts below a folder are left out. Throws FileError when a
/// folder does not exist, or a summary.json is damaged or of another version, InputError when there
/// is no run at all.
std::vector<EvaluationRun> find_runs(const std::vector<std::filesystem::path>& folders);

}  // namespace af::evaluation
