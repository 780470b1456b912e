// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "io/csv_table.h"

namespace af::evaluation {

/// One finished run of af-evaluate, as its folder tells.
struct EvaluationRun {
  std::filesystem::path folder;
  std::string kind;  ///< "image-quality" or "registration"
  nlohmann::json summary;
  std::string name = {};  ///< what tells it from the other runs: the end of its folder's path
  std::filesystem::path page_folder = {};  ///< of the page that links to the run's files

  /// A file of the run. FileError when it is not a plain file name or cannot be read.
  [[nodiscard]] std::string file(const std::string& file_name) const;
  /// A link from the page to a file of the run.
  [[nodiscard]] std::string link(const std::string& file_name) const;
};

/// The finished runs in the given folders and the folders below them, by kind, then path; each
/// once. Repeats of single starts below a folder are left out. FileError: a folder does not exist,
/// or a summary.json is damaged or of another version. InputError: there is no run at all.
std::vector<EvaluationRun> find_runs(const std::vector<std::filesystem::path>& folders);

}  // namespace af::evaluation
