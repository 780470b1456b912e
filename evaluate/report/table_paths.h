// SPDX-License-Identifier: Apache-2.0
// A table as Markdown, and as CSV beside it.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace af::evaluation {

/// The path of the CSV beside a Markdown table: the same name with .csv.
std::filesystem::path csv_beside(const std::filesystem::path& markdown);

/// Why --output cannot name the Markdown table; empty when it can.
std::vector<std::string> table_problems(const std::filesystem::path& output);

}  // namespace af::evaluation
