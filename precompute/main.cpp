// SPDX-License-Identifier: Apache-2.0
#include <CLI/CLI.hpp>

#include "cli/app_main.h"
#include "cli/bind_options.h"
#include "cli/run_limits.h"
#include "precompute/precompute_field.h"

// Outside app_main only the declaration of options can throw, and that would be a defect.
// NOLINTNEXTLINE(bugprone-exception-escape)
int main(int argc, char** argv) {
  af::PrecomputeOptions options;
  CLI::App app{
      "Makes an attenuation field: all line integrals through a CT that one camera can see while "
      "the CT moves within a range. It runs alone, with --processes or under mpirun, with the same "
      "result; stopped, "
      "the same command continues."};
  af::cli::bind_options(app, options);
  af::cli::bind_run_limits(app);
  const std::string command = af::cli::command_line(argc, argv);
  return af::cli::app_main(app, argc, argv, [&](const af::Communicator& world) {
    af::run_precompute(options, command, world);
  });
}
