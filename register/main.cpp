// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <string>

#include <CLI/CLI.hpp>

#include "cli/app_main.h"
#include "cli/bind_lists.h"
#include "cli/bind_options.h"
#include "cli/run_limits.h"
#include "cli/slicer_module.h"
#include "register/optimizer/optimizer.h"
#include "register/registration_run.h"
#include "register/similarity/similarity_measure.h"

namespace {

/// One line per measure: name, "gradient" or "-", "normal-equations" or "-", help; tabs between.
std::string measure_list() {
  std::string text;
  for (const auto& measure : af::registration::known_measures())
    text += std::string(measure.name) + "\t" + (measure.is_differentiable ? "gradient" : "-") +
            "\t" + (measure.is_least_squares ? "normal-equations" : "-") + "\t" + measure.help +
            "\n";
  return text;
}

/// One line per optimiser: name, what it needs of a measure ("-", "gradient", "normal-equations"),
/// help; tabs between.
std::string optimizer_list() {
  const std::array needs{"-", "gradient", "normal-equations"};
  std::string text;
  for (const auto& optimizer : af::registration::known_optimizers())
    text += std::string(optimizer.name) + "\t" + needs.at(optimizer.search.index()) + "\t" +
            optimizer.help + "\n";
  return text;
}

}  // namespace

// Binding options can only throw by a defect, which may well end the program.
// NOLINTNEXTLINE(bugprone-exception-escape)
int main(int argc, char** argv) {
  af::registration::RegisterOptions options;
  CLI::App app{
      "Finds the pose of a CT in the room from calibrated X-rays (2D-3D registration).\nA verdict "
      "says whether the pose is found, doubtful or not found. When no start finds it, the exit "
      "code is 7 and no pose is written."};
  af::cli::bind_options(app, options);
  af::cli::bind_run_limits(app);
  af::cli::bind_lists(app, {{"measures", measure_list()}, {"optimizers", optimizer_list()}});
  af::cli::bind_slicer_module(app, "2D-3D registration");
  const std::string command_line = af::cli::command_line(argc, argv);
  return af::cli::app_main(app, argc, argv, [&](const af::Communicator& world) {
    af::registration::run_registration(options, command_line, world);
  });
}
