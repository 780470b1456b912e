// SPDX-License-Identifier: Apache-2.0
#include <filesystem>
#include <iostream>
#include <optional>
#include <string>

#include <CLI/CLI.hpp>

#include "base/error.h"
#include "cli/app_main.h"
#include "cli/bind_lists.h"
#include "cli/bind_options.h"
#include "cli/run_limits.h"
#include "cli/slicer_module.h"
#include "files/output_file.h"
#include "parallel/work_watch.h"
#include "register/multi_start.h"
#include "register/register_options.h"
#include "register/results/registration_results.h"
#include "register/results/slicer_folder.h"
#include "register/results/target_errors.h"
#include "register/verdict/pose_examiner.h"
#include "register/verdict/view_diagnosis.h"
#include "run/run_folder.h"
#include "run/terminal.h"
#include "study/landmark_start.h"
#include "study/pose_context.h"
#include "study/shared_inputs.h"
#include "text/csv_table.h"
#include "text/options_toml.h"

namespace {

using af::Communicator;
using af::registration::RegisterOptions;

void run(const RegisterOptions& options,
         const std::string& command_line,
         const Communicator& world) {
  using namespace af::registration;
  const RegistrationOptions method = af::all_or_none(world, [&] {
    af::throw_if_any(problems(options));
    RegistrationOptions resolved = resolve(options.method);
    resolved.correction = options.correction;
    if (options.skip_ct_check && resolved.silhouette_mm() > 0.0)
      throw af::InputError(kSilhouettesNeedTheCt);
    return resolved;
  });
  af::RunFolder folder({options.output_folder, result_file_names(), options.resume.restarts},
                       world);
  std::vector<std::string> study_warnings;
  const af::Study study = af::shared_study(options.study, world, &study_warnings);
  for (const std::string& text : study_warnings) af::warn(world, text);
  const af::StudyCase study_case =
      af::all_or_none(world, [&] { return study.find_case(options.case_name); });
  std::optional<af::LandmarkPose> landmarks;
  if (starts_from_landmarks(options, study_case))
    landmarks = af::all_or_none(world, [&] { return af::landmark_pose(study, study_case); });
  std::vector<std::string> notes;
  const std::vector<af::RigidTransform> starts = af::shared_poses(world, [&] {
    if (landmarks.has_value()) return std::vector{landmarks->room_from_ct};
    return start_poses(options, af::pose_context(study, study_case, options.ct), notes);
  });
  for (const std::string& text : notes) af::warn(world, text);
  const auto gold = af::all_or_none(world, [&] { return known_gold(study, study_case); });
  const auto pool = std::make_shared<af::ThreadPool>(af::thread_count(options.method.threads));
  CaseLoadOptions load_options =
      case_load_options(options, method.coarsest_level(), method.last_levels());
  load_options.judging_level = PoseExaminer::coarsest_level();
  load_options.pool = pool;
  const LoadedCase loaded = [&] {
    const af::WorkNote note("loading case " + study_case.name, af::WorkNote::Kind::Phase);
    return load_case(study, study_case, load_options, world);
  }();
  for (const std::string& text : loaded.warnings) af::warn(world, text);
  for (const auto& [input, note] : loaded.input_notes) af::inform(world, input + ": " + note);
  RegistrationRunner runner =
      af::all_or_none(world, [&] { return RegistrationRunner(loaded.problem, method, pool); });
  PoseExaminer examiner =
      af::all_or_none(world, [&] { return PoseExaminer(*loaded.problem, method.silhouette_mm()); });
  UncertaintyEstimator estimator = af::all_or_none(world, [&] {
    return UncertaintyEstimator(loaded.problem, method, options.uncertainty, pool);
  });
  const std::filesystem::path slicer = options.output_folder / "slicer";
  af::all_or_none(world, [&] {
    if (!world.is_root()) return;
    af::announce_outputs(options.output_folder, overlay_file_names(*loaded.problem));
    af::announce_outputs(slicer, slicer_file_names(*loaded.problem));
  });
  folder.open();

  RegisterOptions in_force = options.in_force();
  in_force.case_name = study_case.name;
  RunDescription description{study_case.name, options.renderer, {}, {}};
  if (landmarks.has_value()) description.landmarks = af::to_json(*landmarks, study_case);
  description.provenance = {"af-register",
                            command_line,
                            af::to_toml(in_force),
                            options.method.seed,
                            world.size(),
                            loaded.input_sha256,
                            loaded.input_notes};
  auto& input_sha256 = description.provenance.input_sha256;
  af::all_or_none(world, [&] {
    if (world.is_root()) input_sha256.merge(hashes_of_files(options));
  });
  std::vector<RegistrationRecord> records = register_starts(
      runner,
      examiner,
      estimator,
      starts,
      folder.unfinished("registrations",
                        af::deciding_values(af::deciding_options(in_force), input_sha256)),
      world);
  af::all_or_none(world, [&] {
    if (!world.is_root()) return;
    add_target_errors(gold, study_case.target_box_ct, records);
    RegistrationRecord& best = records[best_record(records)];
    if (!best.view_values.empty() && best.result.evaluations > 0)
      best.diagnosis = diagnose_views(loaded.problem,
                                      best.result.start_room_from_ct,
                                      best.result.room_from_ct,
                                      best.view_values);
    for (const std::string& text : best.diagnosis.messages) af::warn(world, text);
    const Judgement judgement = judgement_of(best);
    // Before result.json: when that is there, everything is.
    if (judgement.verdict == Verdict::NotFound)
      remove_slicer_files(*loaded.problem, slicer);  // an earlier run's
    else
      write_slicer_folder(*loaded.problem, best.result.room_from_ct, study_case, slicer);
    if (landmarks.has_value()) std::cout << af::residuals_text(*landmarks, study_case);
    std::cout << write_run(records, *loaded.problem, description, options.output_folder);
    folder.finish();
    if (judgement.verdict == Verdict::NotFound)
      throw af::NotFoundError("nothing was found (see the verdict); what was searched is in " +
                              options.output_folder.string());
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
      "registrations.csv. A verdict says whether the pose is found, doubtful or not found. Not "
      "found, of any start, is exit code 7: result.tfm, pose.toml and slicer/ are not written."};
  af::cli::bind_options(app, options);
  af::cli::bind_run_limits(app);
  af::cli::bind_lists(app,
                      {{"measures", af::registration::similarity_list()},
                       {"optimizers", af::registration::optimizer_list()}});
  af::cli::bind_slicer_module(app, "2D-3D registration");
  const std::string command_line = af::cli::command_line(argc, argv);
  return af::cli::app_main(
      app, argc, argv, [&](const Communicator& world) { run(options, command_line, world); });
}
