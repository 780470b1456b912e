// SPDX-License-Identifier: Apache-2.0
#include <iostream>
#include <optional>
#include <string>

#include "base/error.h"
#include "cli/app_main.h"
#include "cli/progress_printer.h"
#include "io/csv_table.h"
#include "io/output_file.h"
#include "io/output_lock.h"
#include "io/study_file.h"
#include "register/method_command.h"
#include "register/multi_start_program.h"
#include "register/register_command.h"
#include "register/slicer_files.h"
#include "register/target_errors_program.h"

namespace {

using af::Communicator;
using af::registration::RegisterOptions;

void bind_start(CLI::App& app, RegisterOptions& options) {
  app.add_option("--start-rotation-deg",
                 options.start_rotation_deg,
                 "Start: rx,ry,rz about the room's axes through the ROI centre, degrees, relative "
                 "to the case's nominal pose (default 0,0,0)")
      ->delimiter(',');
  app.add_option("--start-translation-mm",
                 options.start_translation_mm,
                 "Start: tx,ty,tz along the room's axes, mm, relative to nominal (default 0,0,0)")
      ->delimiter(',');
  app.add_option("--start-pose",
                 options.start_pose,
                 "Start: file with room_from_ct (TOML, JSON, ITK .tfm or 16 numbers)");
  app.add_option("--starts",
                 options.starts,
                 "CSV of many starts: rx_deg,ry_deg,rz_deg,tx_mm,ty_mm,tz_mm relative to nominal, "
                 "or m00 ... m23 of room_from_ct; under mpirun the ranks share them");
}

void bind_renderer(CLI::App& app, RegisterOptions& options) {
  app.add_option("--renderer",
                 options.renderer,
                 "How DRRs are made: 'field' looks them up, 'raycast' casts rays through the CT")
      ->check(CLI::IsMember({"field", "raycast"}))
      ->capture_default_str();
  bind_method(app, options.method);
  app.add_option("--seed", options.method.seed, "Of the random numbers that cma-es draws")
      ->capture_default_str();
}

void bind_options(CLI::App& app, RegisterOptions& options) {
  app.add_option("--study", options.study, "study.toml: rig, cases, X-rays")->required();
  app.add_option(
      "--case", options.case_name, "Case of the study (may be left out when it has one)");
  app.add_option("--field",
                 options.fields,
                 "CAMERA=FIELD.h5, once per camera; replaces the study's `field`")
      ->allow_extra_args(false);
  bind_renderer(app, options);
  bind_start(app, options);
  app.add_option("--water-mu-per-mm",
                 options.water_mu_per_mm,
                 "Attenuation of water, 1/mm, for ray casting (a field has its own)")
      ->capture_default_str();
  app.add_option("--step-mm", options.step_mm, "Longest step of ray casting, mm")
      ->capture_default_str();
  app.add_option(
      "--series", options.series_uid, "DICOM series UID, when the CT's folder has several");
  app.add_flag("--skip-ct-check",
               options.skip_ct_check,
               "Do not read the CT (it may be absent): fields are trusted to be of this case");
  app.add_option("-o,--output", options.output_folder, "Folder for the results")->required();
}

void run(const RegisterOptions& options,
         const std::string& command_line,
         const Communicator& world) {
  using namespace af::registration;
  const RegistrationOptions method = af::all_or_none(world, [&] {
    af::throw_if_any(problems(options));
    return resolve(options.method);
  });
  std::vector<std::string> study_warnings;
  const af::Study study =
      af::all_or_none(world, [&] { return af::read_study(options.study, &study_warnings); });
  for (const std::string& text : study_warnings) af::cli::warn(world, text);
  const af::StudyCase study_case =
      af::all_or_none(world, [&] { return study.find_case(options.case_name); });
  const std::vector<af::RigidTransform> starts =
      af::all_or_none(world, [&] { return start_poses(options, study_case.frame()); });
  const auto gold = af::all_or_none(world, [&] { return known_gold(study, study_case); });
  const auto pool = std::make_shared<af::ThreadPool>(af::thread_count(options.method.threads));
  CaseLoadOptions load_options = case_load_options(options, method.coarsest_level());
  load_options.pool = pool;
  const LoadedCase loaded = load_case(study, study_case, load_options, world);
  for (const std::string& text : loaded.warnings) af::cli::warn(world, text);
  RegistrationRunner runner =
      af::all_or_none(world, [&] { return RegistrationRunner(loaded.problem, method, pool); });
  // Before the work, so that an unwritable folder does not cost it; after the inputs, so that bad
  // ones leave nothing behind.
  std::optional<af::OutputLock> lock;
  af::all_or_none(world, [&] {
    if (!world.is_root()) return;
    af::make_output_folder(options.output_folder);
    lock.emplace(options.output_folder);
  });

  af::cli::ProgressPrinter printer("registrations", world.is_root() && starts.size() > 1);
  const auto total = static_cast<double>(starts.size());
  std::vector<RegistrationRecord> records =
      register_starts(runner, starts, world, [&](std::int64_t done) {
        printer.update(static_cast<double>(done), total);
      });
  af::all_or_none(world, [&] {
    if (!world.is_root()) return;
    add_target_errors(gold, study_case.target_box_ct, records);
    RunDescription description{study_case.name, options.renderer, {}};
    description.provenance = {"af-register",
                              command_line,
                              to_toml(options, method),
                              options.method.seed,
                              world.size(),
                              loaded.input_sha256};
    // Before result.json: when that is there, everything is.
    write_slicer_folder(*loaded.problem,
                        records[best_record(records)].result.room_from_ct,
                        study_case,
                        options.output_folder / "slicer");
    std::cout << write_run(records, *loaded.problem, description, options.output_folder);
  });
}

}  // namespace

// Binding options can throw only by a defect, which may well end the program.
// NOLINTNEXTLINE(bugprone-exception-escape)
int main(int argc, char** argv) {
  RegisterOptions options;
  CLI::App app{
      "Finds the pose of a CT in the room from calibrated X-rays (2D-3D registration).\n"
      "Writes result.json, pose.toml, result.tfm (ct_from_room, for Slicer), one overlay picture "
      "per view, slicer/ (a folder that 3D Slicer loads) and reproduce.sh; with --starts also "
      "registrations.csv."};
  bind_options(app, options);
  const std::string command_line = af::cli::command_line(argc, argv);
  return af::cli::app_main(
      app, argc, argv, [&](const Communicator& world) { run(options, command_line, world); });
}
