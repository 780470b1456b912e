// SPDX-License-Identifier: Apache-2.0
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "cli/app_main.h"
#include "cli/sub_command.h"
#include "evaluate/image_quality/evaluate_image_quality.h"
#include "evaluate/image_quality/measure_held_out.h"
#include "evaluate/registration/compare_methods.h"
#include "evaluate/registration/evaluate_registrations.h"
#include "evaluate/registration/evaluated_methods.h"
#include "evaluate/registration/join_studies.h"
#include "evaluate/registration/measure_population.h"
#include "evaluate/report/make_report.h"
#include "evaluate/sweeps/draw_similarity_curves.h"
#include "evaluate/sweeps/make_error_budget.h"
#include "evaluate/sweeps/measure_lattice_errors.h"
#include "evaluate/sweeps/sweep_field_parameters.h"
#include "files/shell_words.h"

// Outside app_main only the declaration of options can throw, and that would be a defect.
// NOLINTNEXTLINE(bugprone-exception-escape)
int main(int argc, char** argv) {
  using namespace af::evaluation;
  CLI::App app{
      "Measures attenuation fields and registrations, alone or under mpirun, with the same "
      "numbers."};
  app.require_subcommand(1);
  const std::string program = af::shell_quoted(argv[0]);
  const std::vector<af::cli::SubCommand> commands = {image_quality_command(app),
                                                     held_out_command(app),
                                                     registration_command(app, program),
                                                     similarity_curves_command(app),
                                                     field_parameters_command(app),
                                                     compare_command(app),
                                                     error_budget_command(app),
                                                     lattice_errors_command(app),
                                                     join_studies_command(app),
                                                     population_command(app),
                                                     report_command(app),
                                                     method_command(app)};
  const std::string command_line = af::cli::command_line(argc, argv);
  const auto run = [&](const af::Communicator& world) {
    for (const af::cli::SubCommand& command : commands)
      if (command.app->parsed()) command.run(command_line, world);
  };
  return af::cli::app_main(app, argc, argv, run);
}
