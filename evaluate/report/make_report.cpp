// SPDX-License-Identifier: Apache-2.0
#include "evaluate/report/make_report.h"

#include "evaluate/report/report_program.h"
#include "files/output_file.h"
#include "ranks/root_only.h"

namespace af::evaluation {

void ReportOptions::describe(Fields& field) {
  field("runs", runs, "Folders of finished runs; all their subfolders are searched, too")
      .as("RUN")
      .required();
  field("output", output, "The page to write").as("-o,--output");
  field("title", title, "Its title (default: made from the cases' names)");
}

namespace {

void run_report(const ReportOptions& options,
                const std::string& /*command_line*/,
                const Communicator& world) {
  do_on_root(world, [&] {
    announce_output(options.output);
    std::vector<std::string> arguments = {"--output=" + options.output.string()};
    if (!options.title.empty()) arguments.push_back("--title=" + options.title);
    arguments.emplace_back("--");
    for (const std::filesystem::path& run : options.runs) arguments.push_back(run.string());
    run_af_report(arguments);
  });
}

}  // namespace

cli::SubCommand report_command(CLI::App& app) {
  return cli::sub_command(app,
                          "report",
                          "One HTML page of finished runs: findings, figures, tables, failures and "
                          "the commands that repeat them. Starts af-report",
                          run_report);
}

}  // namespace af::evaluation
