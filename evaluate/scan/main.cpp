// SPDX-License-Identifier: Apache-2.0
// af-scan makes a registration study of real X-rays, whose true pose is known, from a circular
// scan.
#include <string>

#include <CLI/CLI.hpp>

#include "cli/app_main.h"
#include "cli/bind_options.h"
#include "evaluate/scan/scan_run.h"

// Outside app_main only the declaration of options can throw, and that would be a defect.
// NOLINTNEXTLINE(bugprone-exception-escape)
int main(int argc, char** argv) {
  using namespace af;
  tools::ScanOptions options;
  CLI::App app{
      "Makes a registration study of real X-rays from a circular cone-beam scan: the even views "
      "give geometry and CT, odd views are the X-rays, whose true pose is the identity."};
  cli::bind_options(app, options);
  const std::string command_line = cli::command_line(argc, argv);
  return cli::app_main(app, argc, argv, [&](const Communicator& world) {
    tools::run_scan(options, command_line, world);
  });
}
