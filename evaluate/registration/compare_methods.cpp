// SPDX-License-Identifier: Apache-2.0
#include "evaluate/registration/compare_methods.h"

#include <iostream>

#include <CLI/CLI.hpp>

#include "base/error.h"
#include "cli/bind_options.h"
#include "evaluate/registration/method_comparison.h"
#include "files/output_file.h"

namespace af::evaluation {

void CompareOptions::describe(Fields& field) {
  field("runs", runs, "Folders of finished runs, searched with all below them")
      .as("RUN")
      .required();
  field("output", output, "The Markdown file; the CSV takes its name, .csv").as("-o,--output");
  field("screen", is_screen, "In Markdown, measures against optimisers instead of a row per run");
}

CLI::App* bind_compare(CLI::App& app, CompareOptions& options) {
  CLI::App* command = app.add_subcommand(
      "compare",
      "One table of finished registration runs: success for starts 0-8, 8-16 and 16-30 mm from "
      "gold, TRE, bias, DRRs and seconds, and field against ray casting, as Markdown and CSV");
  cli::bind_options(*command, options);
  return command;
}

void run_compare(const CompareOptions& options, const Communicator& world) {
  all_or_none(world, [&] {
    if (!world.is_root()) return;
    std::filesystem::path csv = options.output;
    csv.replace_extension(".csv");
    announce_output(csv);
    announce_output(options.output);
    const std::vector<EvaluationRun> runs = find_runs(options.runs);
    const std::vector<MethodRow> rows = method_rows(runs);
    if (rows.empty())
      throw InputError("RUN", options.runs.front().string(), "holds no finished registration run");
    std::vector<std::string> parts = {options.is_screen ? screen_markdown(rows)
                                                        : methods_markdown(rows)};
    std::string text;
    if (!options.is_screen) parts.push_back(studies_markdown(rows));
    parts.push_back(pairs_markdown(runs));
    for (const std::string& part : parts)
      if (!part.empty()) text += (text.empty() ? "" : "\n") + part;
    write_text_file(csv, methods_table(rows).to_text());
    write_text_file(options.output, text);
    std::cout << text;
  });
}

}  // namespace af::evaluation
