// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "base/described_fields.h"
#include "cli/sub_command.h"

namespace af::evaluation {

/// `af-evaluate report` as typed.
struct ReportOptions {
  std::vector<std::filesystem::path> runs;
  std::filesystem::path output = "report.html";
  std::string title;

  void describe(Fields& field);
};

/// Collective; rank 0 works. Starts af-report on finished runs.
cli::SubCommand report_command(CLI::App& app);

}  // namespace af::evaluation
