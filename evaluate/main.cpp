// SPDX-License-Identifier: Apache-2.0
#include "cli/app_main.h"
#include "evaluate/image_quality_command.h"
#include "evaluate/registration_command.h"
#include "evaluate/report_command.h"

int main(int argc, char** argv) {
  CLI::App app{
      "Measures attenuation fields and registrations, as a paper would report them. Runs alone or "
      "under mpirun; the numbers do not depend on the rank count."};
  app.require_subcommand(1);
  af::evaluation::ImageQualityOptions image_quality;
  const CLI::App* image_quality_command = bind_image_quality(app, image_quality);
  af::evaluation::RegistrationStudyOptions registration;
  const CLI::App* registration_command = bind_registration(app, registration);
  af::evaluation::ReportOptions report;
  const CLI::App* report_command = bind_report(app, report);
  const std::string command_line = af::cli::command_line(argc, argv);
  return af::cli::app_main(app, argc, argv, [&](const af::Communicator& world) {
    if (image_quality_command->parsed()) run_image_quality(image_quality, command_line, world);
    if (registration_command->parsed()) run_registration(registration, command_line, world);
    if (report_command->parsed()) run_report(report, world);
  });
}
