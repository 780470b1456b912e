// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "evaluate/report/evaluation_run_files.h"
#include "parallel/communicator.h"

namespace af::evaluation {

/// `af-evaluate report` as typed.
struct ReportOptions {
  std::vector<std::filesystem::path> runs;
  std::filesystem::path output = "report.html";
  std::string title;
};

/// Adds the subcommand; returns it.
CLI::App* bind_report(CLI::App& app, ReportOptions& options);

/// The whole page, self-contained: style, figures and pictures are part of it. Figures that join
/// several runs are also left beside it, in `output`'s name with "-figures" for its extension.
std::string report_page(std::vector<EvaluationRun> runs,
                        const std::filesystem::path& output,
                        const std::string& title);

/// Collective; rank 0 works. Writes the report of finished runs.
void run_report(const ReportOptions& options, const Communicator& world);

}  // namespace af::evaluation
