// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "text/csv_table.h"

namespace af::evaluation {

/// One finished run of af-evaluate, as its folder tells.
// nlohmann::json asserts in its move constructor.
// NOLINTNEXTLINE(bugprone-exception-escape)
struct EvaluationRun {
  std::filesystem::path folder;
  std::string kind;  ///< "image-quality" or "registration"
  nlohmann::json summary;
  std::string name = {};  ///< what tells it from the other runs: the end of its folder's path
  std::filesystem::path page_folder = {};  ///< of the page that links to the run's files

  /// Where a file of the run lies, named by its path below the folder. FileError when that, or a
  /// link in it, leads out of the folder.
  [[nodiscard]] std::filesystem::path path_of(const std::string& relative) const;
  /// Whether path_of() is a file.
  [[nodiscard]] bool has_file(const std::string& relative) const;
  /// A file of the run. FileError when it is not a plain file name, leads out of the folder or
  /// cannot be read.
  [[nodiscard]] std::string file(const std::string& file_name) const;
  /// A table of the run, named by its path below the folder. FileError as of file(), or no CSV.
  [[nodiscard]] CsvTable table(const std::string& relative) const;
  /// Reads a table of any length in parts; table() refuses one of 256 MB.
  void read_in_parts(const std::string& relative,
                     const std::function<void(const CsvTable& part)>& receive) const;
  /// A link from the page to a file or folder of the run, named by its path below the folder.
  /// FileError when that leads out of it.
  [[nodiscard]] std::string link(const std::string& relative) const;

 private:
  [[nodiscard]] std::filesystem::path existing(const std::string& relative) const;
};

/// The finished runs in the given folders and the folders below them, by kind, then path; each
/// once. Repeats of single starts below a folder are left out. FileError: a folder does not exist,
/// or a summary.json is damaged, of another version or a link to elsewhere. InputError: there is no
/// run at all.
std::vector<EvaluationRun> find_runs(const std::vector<std::filesystem::path>& folders);

}  // namespace af::evaluation
