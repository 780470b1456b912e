// SPDX-License-Identifier: Apache-2.0
#include <CLI/CLI.hpp>

#include "cli/app_main.h"
#include "cli/bind_options.h"
#include "tools/inspect/inspect_run.h"

// Binding options can only throw by a defect, which may well end the program.
// NOLINTNEXTLINE(bugprone-exception-escape)
int main(int argc, char** argv) {
  af::InspectOptions options;
  CLI::App app{
      "Says what files are, whether they are sane, and what they were made from. The exit code is "
      "the worst over all paths: 0 usable, 3 unacceptable, 4 damaged."};
  af::cli::bind_options(app, options);
  return af::cli::app_main(
      app, argc, argv, [&](const af::Communicator& world) { run_inspect(options, world); });
}
