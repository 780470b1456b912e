// SPDX-License-Identifier: Apache-2.0
#include <CLI/CLI.hpp>

#include "cli/app_main.h"
#include "cli/bind_options.h"
#include "cli/slicer_module.h"
#include "tools/drr/drr_request.h"

// Binding options can only throw by a defect, which may well end the program.
// NOLINTNEXTLINE(bugprone-exception-escape)
int main(int argc, char** argv) {
  af::tools::DrrOptions options;
  CLI::App app{
      "Makes digitally reconstructed radiographs, from an attenuation field or by ray casting."};
  af::cli::bind_options(app, options);
  af::cli::bind_slicer_module(app, "Digitally reconstructed radiograph");
  return af::cli::app_main(
      app, argc, argv, [&](const af::Communicator& world) { run_drr(options, world); });
}
