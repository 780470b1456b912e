// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "base/described_fields.h"
#include "cli/app_forward.h"
#include "parallel/communicator.h"

namespace af::evaluation {

/// `af-evaluate report` as typed.
struct ReportOptions {
  std::vector<std::filesystem::path> runs;
  std::filesystem::path output = "report.html";
  std::string title;

  void describe(Fields& field);
};

/// Adds the subcommand; returns it.
CLI::App* bind_report(CLI::App& app, ReportOptions& options);

/// Collective; rank 0 works. Writes the report of finished runs.
void run_report(const ReportOptions& options, const Communicator& world);

}  // namespace af::evaluation
