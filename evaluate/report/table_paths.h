// SPDX-License-Identifier: Apache-2.0
// A table in Markdown, and the same as CSV beside it.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace af::evaluation {

/// Where the CSV of a table in Markdown stands: its name, .csv.
std::filesystem::path csv_beside(const std::filesystem::path& markdown);

/// Why --output cannot name the table in Markdown; empty when it can.
std::vector<std::string> table_problems(const std::filesystem::path& output);

}  // namespace af::evaluation
