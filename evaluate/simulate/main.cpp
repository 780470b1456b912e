// SPDX-License-Identifier: Apache-2.0
// af-simulate makes a whole registration study, with a known answer, from a CT or a phantom.
#include <string>

#include <CLI/CLI.hpp>

#include "cli/app_main.h"
#include "cli/bind_options.h"
#include "evaluate/simulate/simulated_study.h"

// Outside app_main only the declaration of options can throw, and that would be a defect.
// NOLINTNEXTLINE(bugprone-exception-escape)
int main(int argc, char** argv) {
  af::tools::SimulateOptions options;
  CLI::App app{
      "Makes a registration study with a known answer: realistic X-rays of a CT or phantom, "
      "fiducials and the true pose. With --cone-beam a circular scan for af-scan instead."};
  af::cli::bind_options(app, options);
  const std::string command_line = af::cli::command_line(argc, argv);
  return af::cli::app_main(app, argc, argv, [&](const af::Communicator& world) {
    run_simulate(options, command_line, world);
  });
}
