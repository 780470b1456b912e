// SPDX-License-Identifier: Apache-2.0
#include <CLI/CLI.hpp>

#include "cli/app_main.h"
#include "evaluate/image_quality/evaluate_image_quality.h"
#include "evaluate/image_quality/measure_held_out.h"
#include "evaluate/methods/evaluated_methods.h"
#include "evaluate/population/measure_population.h"
#include "evaluate/registration/compare_methods.h"
#include "evaluate/registration/evaluate_registrations.h"
#include "evaluate/registration/join_studies.h"
#include "evaluate/report/make_report.h"
#include "evaluate/sweeps/draw_similarity_curves.h"
#include "evaluate/sweeps/make_error_budget.h"
#include "evaluate/sweeps/measure_lattice_errors.h"
#include "evaluate/sweeps/sweep_field_parameters.h"
#include "text/shell_words.h"

int main(int argc, char** argv) {
  CLI::App app{
      "Measures attenuation fields and registrations, as a paper would report them. Runs alone or "
      "under mpirun; the numbers do not depend on the rank count."};
  app.require_subcommand(1);
  af::evaluation::ImageQualityOptions image_quality;
  const CLI::App* image_quality_command = bind_image_quality(app, image_quality);
  af::evaluation::HeldOutOptions held_out;
  const CLI::App* held_out_command = bind_held_out(app, held_out);
  af::evaluation::RegistrationStudyOptions registration;
  const CLI::App* registration_command = bind_registration(app, registration);
  af::evaluation::SimilarityCurvesOptions curves;
  const CLI::App* curves_command = bind_similarity_curves(app, curves);
  af::evaluation::FieldParametersOptions field_parameters;
  const CLI::App* field_parameters_command = bind_field_parameters(app, field_parameters);
  af::evaluation::CompareOptions compare;
  const CLI::App* compare_command = bind_compare(app, compare);
  af::evaluation::ErrorBudgetOptions error_budget;
  const CLI::App* error_budget_command = bind_error_budget(app, error_budget);
  af::evaluation::LatticeErrorsOptions lattice_errors;
  const CLI::App* lattice_errors_command = bind_lattice_errors(app, lattice_errors);
  af::evaluation::JoinStudiesOptions join;
  const CLI::App* join_command = bind_join_studies(app, join);
  af::evaluation::PopulationOptions population;
  const CLI::App* population_command = bind_population(app, population);
  af::evaluation::ReportOptions report;
  const CLI::App* report_command = bind_report(app, report);
  af::registration::MethodOptions method;
  const CLI::App* method_command = af::evaluation::bind_show_method(app, method);
  const std::string command_line = af::cli::command_line(argc, argv);
  registration.program = af::shell_quoted(argv[0]);
  return af::cli::app_main(app, argc, argv, [&](const af::Communicator& world) {
    if (image_quality_command->parsed()) run_image_quality(image_quality, command_line, world);
    if (held_out_command->parsed()) run_held_out(held_out, world);
    if (registration_command->parsed()) run_registration(registration, command_line, world);
    if (curves_command->parsed()) run_similarity_curves(curves, command_line, world);
    if (field_parameters_command->parsed())
      run_field_parameters(field_parameters, command_line, world);
    if (compare_command->parsed()) run_compare(compare, world);
    if (error_budget_command->parsed()) run_error_budget(error_budget, command_line, world);
    if (lattice_errors_command->parsed()) run_lattice_errors(lattice_errors, world);
    if (join_command->parsed()) run_join_studies(join, world);
    if (population_command->parsed()) run_population(population, world);
    if (method_command->parsed()) af::evaluation::show_method(method, world);
    if (report_command->parsed()) run_report(report, world);
  });
}
