// SPDX-License-Identifier: Apache-2.0
#include "evaluate/registration/measure_population.h"

#include <iostream>
#include <utility>

#include "evaluate/registration/population_runs.h"
#include "evaluate/registration/population_tables.h"
#include "evaluate/report/report_program.h"
#include "files/output_file.h"
#include "ranks/root_only.h"

namespace af::evaluation {

namespace {

void write_population(const PopulationOptions& options,
                      const PopulationReader& reader,
                      const Communicator& world) {
  std::vector<PopulationGroup> groups;
  for (const PopulationCondition& condition : reader.conditions())
    for (PopulationGroup& group : groups_of(condition, reader.counting()))
      groups.push_back(std::move(group));
  const OutputLock lock = make_output_folder(options.output);
  write_text_file(options.output / "population.csv",
                  population_table(groups, reader.counting().success_mm).to_text());
  write_text_file(options.output / "patients.csv", patients_table(groups).to_text());
  write_text_file(options.output / "intervals.csv", intervals_table(groups).to_text());
  draw_results({options.output.string()}, world);
  std::cout << "results: " << options.output.string() << '\n';
}

}  // namespace

void PopulationOptions::describe(Fields& field) {
  field("condition",
        conditions,
        "VARIANT-VIEWS-PRESET=FOLDER: finished registration runs of one condition, in and below "
        "the folder; may be repeated")
      .required()
      .one_at_a_time();
  field("seed", seed, "Seed of the bootstrap");
  field("output", output, "Folder for tables and figures").as("-o,--output");
}

namespace {

void run_population(const PopulationOptions& options,
                    const std::string& /*command_line*/,
                    const Communicator& world) {
  do_on_root(world, [&] {
    PopulationReader reader(options.seed);
    for (const std::string& condition : options.conditions) reader.read(condition);
    write_population(options, reader, world);
  });
}

}  // namespace

cli::SubCommand population_command(CLI::App& app) {
  return cli::sub_command(app,
                          "population",
                          "Success and capture range of many patients, with intervals over "
                          "patients; a case named PATIENT-pN is a pose of that patient",
                          run_population);
}

}  // namespace af::evaluation
