// SPDX-License-Identifier: Apache-2.0
#include "evaluate/report/table_paths.h"

namespace af::evaluation {

std::filesystem::path csv_beside(const std::filesystem::path& markdown) {
  std::filesystem::path csv = markdown;
  csv.replace_extension(".csv");
  return csv;
}

std::vector<std::string> table_problems(const std::filesystem::path& output) {
  if (output.extension() == ".md") return {};
  return {"--output = " + output.string() +
          ": must name the Markdown file, such as NAME.md; the CSV is written beside it"};
}

}  // namespace af::evaluation
