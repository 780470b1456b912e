// SPDX-License-Identifier: Apache-2.0
// A program in which one rank stops while the others end.
#include <csignal>

#include <CLI/CLI.hpp>

#include "cli/app_main.h"
#include "cli/run_limits.h"

int main(int argc, char** argv) {
  CLI::App app{"Rank 1 stops itself; the others have nothing to do."};
  af::cli::bind_run_limits(app);
  return af::cli::app_main(app, argc, argv, [](const af::Communicator& world) {
    if (world.rank() == 1) std::raise(SIGSTOP);
  });
}
