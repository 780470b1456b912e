// SPDX-License-Identifier: Apache-2.0
#include "register/registration_run.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cstddef>
#include <filesystem>
#include <iostream>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <numeric>
#include <optional>

#include "base/error.h"
#include "base/joined.h"
#include "base/stored_bytes.h"
#include "files/csv_table.h"
#include "files/foreign_file.h"
#include "files/options_toml.h"
#include "files/output_file.h"
#include "files/sha256.h"
#include "files/shell_words.h"
#include "geometry/target_box.h"
#include "geometry/tre.h"
#include "ranks/root_only.h"
#include "ranks/run_folder.h"
#include "ranks/terminal.h"
#include "ranks/work_watch.h"
#include "register/results/registration_results.h"
#include "register/results/slicer_folder.h"
#include "study/case_gold_standard.h"
#include "study/landmark_start.h"
#include "study/pose_file.h"
#include "study/shared_inputs.h"

namespace af::registration {
namespace {

/// Rank 0: the records of all starts. The best keeps its trace.
std::vector<RegistrationRecord> records_of(const ResumableItems& items, std::size_t count) {
  std::vector<RegistrationRecord> records(count);
  std::optional<RegistrationRecord> best;
  items.visit([&](std::int64_t index, std::span<const std::byte> bytes) {
    auto record = value_of<RegistrationRecord>(bytes, "unfinished registrations");
    if (!best.has_value() || is_better(record, *best)) best = record;
    record.result.trace.clear();
    records[static_cast<std::size_t>(index)] = std::move(record);
  });
  if (best.has_value()) records[best_record(records)].result.trace = best->result.trace;
  return records;
}

/// Whether the case's landmarks give the start: they are asked for, or the case has landmarks and
/// no start is given.
bool starts_from_landmarks(const RegisterOptions& options, const StudyCase& study_case) {
  const bool has_start = options.start_rotation_deg.has_value() ||
                         options.start_translation_mm.has_value() || !options.start_pose.empty() ||
                         !options.starts.empty();
  if (options.start == "landmarks") return true;
  return options.start == "auto" && !has_start && has_landmarks(study_case);
}

/// SHA-256 of the study and, if given, of the file of starts, by name.
InputIdentities hashes_of_files(const RegisterOptions& options) {
  InputIdentities hashes = {{"study", sha256_of_file(options.study.string())}};
  if (!options.starts.empty()) hashes["starts"] = sha256_of_file(options.starts.string());
  return hashes;
}

/// Collective. The preset with its replacements, refused where the command line contradicts it.
RegistrationOptions method_of(const RegisterOptions& options, const Communicator& world) {
  return all_or_none(world, [&] {
    throw_if_any(problems(options));
    RegistrationOptions method = resolve(options.method);
    method.correction = options.correction;
    if (options.skip_ct_check && method.silhouette_mm() > 0.0)
      throw InputError(kSilhouettesNeedTheCt);
    return method;
  });
}

/// Where the likeliest pose of a search lies at an end of its range.
struct SearchEnd {
  std::string along;  ///< names of parameters; empty: nowhere
  std::string wider;  ///< PoseSearch::options_beyond()
};

/// What the study says about the case, the same on every rank.
struct CaseToRegister {
  Shared<Study> study;
  StudyCase study_case;
  std::optional<LandmarkPose> landmarks;  ///< when they give the start
  nlohmann::json search;                  ///< when a search found the starts; on rank 0
  SearchEnd search_end;                   ///< likewise
  std::vector<RigidTransform> starts;
  std::optional<GoldStandard> gold;
};

void warn_of(const std::vector<std::string>& texts, const Communicator& world) {
  for (const std::string& text : texts) warn(world, text);
}

/// Collective.
CaseToRegister read_case(const RegisterOptions& options, const Communicator& world) {
  CaseToRegister found{shared_study(options.study, world), {}, {}, {}, {}, {}, {}};
  found.study_case = all_or_none(world, [&] { return found.study->find_case(options.case_name); });
  if (starts_from_landmarks(options, found.study_case))
    found.landmarks =
        all_or_none(world, [&] { return landmark_pose(found.study, found.study_case); });
  std::vector<std::string> notes;
  found.starts = shared_poses(world, [&] {
    if (found.landmarks.has_value()) return std::vector{found.landmarks->room_from_ct};
    if (options.start == "search") return std::vector<RigidTransform>();  // find_starts()
    return start_poses(
        options,
        {found.study_case.frame(), conversion_options(options.study, found.study_case.name)},
        notes);
  });
  warn_of(notes, world);
  found.gold = all_or_none(world, [&] { return known_gold(found.study, found.study_case); });
  return found;
}

/// Collective. The problem of the case, with X-rays and renderers.
LoadedCase load_problem(const RegisterOptions& options,
                        const RegistrationOptions& method,
                        const CaseToRegister& registered,
                        const std::shared_ptr<ThreadPool>& pool,
                        const Communicator& world) {
  CaseLoadOptions load = case_load_options(options, method.coarsest_level(), method.last_levels());
  if (options.start == "search")
    load.coarsest_level = std::max(load.coarsest_level, coarsest_level(options.search));
  load.judging_level = PoseExaminer::coarsest_level();
  load.region_follows_target = method.region_follows_target;
  load.pool = pool;
  const WorkNote note("loading case " + registered.study_case.name, WorkNote::Kind::Phase);
  LoadedCase loaded = load_case(registered.study, registered.study_case, load, world);
  warn_of(loaded.warnings, world);
  for (const auto& [input, text] : loaded.input_notes)
    inform(world, std::string(input).append(": ").append(text));
  return loaded;
}

nlohmann::json search_json(const PoseSearch& search,
                           const std::vector<PoseMode>& modes,
                           const SearchEnd& end,
                           double seconds) {
  nlohmann::json likenesses = nlohmann::json::array();
  for (const PoseMode& mode : modes) likenesses.push_back(mode.likeness);
  return {{"range", search.range().text()},
          {"range_ends_along", end.along},
          {"rotations", search.rotation_count()},
          {"likeness_per_start", likenesses},
          {"seconds", seconds}};
}

std::string search_text(const PoseSearch& search,
                        const std::vector<PoseMode>& modes,
                        double seconds) {
  return "search      " + std::to_string(search.rotation_count()) + " rotations, " +
         search.range().text() + ", in " + fixed_text(seconds, 2) +
         " s: " + std::to_string(modes.size()) + " starts, likeness " +
         joined(modes, ", ", [](const PoseMode& mode) { return fixed_text(mode.likeness, 2); }) +
         "\n";
}

/// Collective. Rank 0 looks for starts where they are not known.
void find_starts(const RegisterOptions& options,
                 const RegistrationOptions& method,
                 const RegistrationProblem& problem,
                 const std::shared_ptr<ThreadPool>& pool,
                 const Communicator& world,
                 CaseToRegister& registered) {
  if (options.start != "search") return;
  const WorkNote note("searching for starts", WorkNote::Kind::Phase);
  registered.starts = shared_poses(world, [&] {
    const auto begin = std::chrono::steady_clock::now();
    const PoseSearch search(problem, options.search, method.silhouette_mm(), pool);
    const std::vector<PoseMode> modes = search.modes();
    const double seconds =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    const ParameterSet ends = search.ends_at(modes.front().room_from_ct);
    registered.search_end = {parameter_names(ends), search.options_beyond(ends)};
    registered.search = search_json(search, modes, registered.search_end, seconds);
    std::cout << search_text(search, modes, seconds);
    std::vector<RigidTransform> starts;
    for (const PoseMode& mode : modes) starts.push_back(mode.room_from_ct);
    return starts;
  });
}

/// README.md, "How it works", measures 20 registrations on a skull.
constexpr const char* kCastsWithoutFields =
    "renderer: raycast, as neither the study nor --field names a field. Fields (af-precompute) pay "
    "from about 20 registrations of this CT on: making them takes as long as a dozen or more by "
    "ray casting\n";

/// Collective. What the results say of the run beside its records.
RunDescription description_of(const RegisterOptions& in_force,
                              const CaseToRegister& registered,
                              const LoadedCase& loaded,
                              const std::string& command_line,
                              const Communicator& world) {
  RunDescription description{
      registered.study_case.name, in_force.renderer, {}, {}, {}, !in_force.pictures.are_left_out};
  if (registered.landmarks.has_value())
    description.landmarks = to_json(*registered.landmarks, registered.study_case);
  description.search = registered.search;
  description.provenance = {"af-register",
                            command_line,
                            to_toml(in_force),
                            in_force.method.seed,
                            world.size(),
                            loaded.inputs,
                            loaded.input_notes};
  do_on_root(world, [&] { description.provenance.inputs.merge(hashes_of_files(in_force)); });
  return description;
}

/// Says how many starts were clipped, and the first of them.
void warn_of_clipped(const std::vector<RegistrationRecord>& records, const Communicator& world) {
  const auto is_clipped = [](const RegistrationRecord& record) {
    return !record.result.clipped_along.empty();
  };
  const auto first = std::ranges::find_if(records, is_clipped);
  if (first == records.end()) return;
  warn(world,
       std::to_string(std::ranges::count_if(records, is_clipped)) + " of " +
           std::to_string(records.size()) + " starts lay outside the field's range (start " +
           std::to_string(first->start_index) + " along " + first->result.clipped_along +
           ") and were clipped into it");
}

/// Says what comes next where the range of the search or of the fields ends.
void offer_search(const RegisterOptions& options,
                  const RegistrationRecord& best,
                  const SearchEnd& search_end,
                  const Communicator& world) {
  // Rotations are coarse, so the right pose often lies in an outer cell. Where it was found, there
  // is nothing to search for.
  const bool is_at_end = !search_end.along.empty() && judgement_of(best).verdict != Verdict::Found;
  if (is_at_end)
    inform(world,
           "the likeliest pose lies at the end of the searched range (" + search_end.along + ")" +
               (search_end.wider.empty() ? "" : ": search further with " + search_end.wider));
  if (best.result.pinned_along.empty() && best.result.clipped_along.empty() &&
      !(is_at_end && search_end.wider.empty()))
    return;
  inform(world,
         "beyond the fields' range: 'af-register " + shell_quoted(options.study.string()) +
             " --renderer raycast --start search' looks for the pose there. Wider fields: "
             "af-precompute --max-rotation-deg and --max-translation-mm");
}

void add_target_errors(const CaseToRegister& registered, std::vector<RegistrationRecord>& records) {
  if (!registered.gold.has_value()) return;
  const std::vector<Eigen::Vector3d> points = target_points(registered.study_case.target_box_ct);
  const auto error_mm = [&](const RigidTransform& pose) {
    return mean_tre_mm(pose, registered.gold->room_from_ct, points);
  };
  for (RegistrationRecord& record : records)
    record.errors = TargetErrors{registered.gold->source,
                                 error_mm(record.result.start_room_from_ct),
                                 error_mm(record.result.room_from_ct)};
}

/// Rank 0. Writes what was found, the summary last. NotFoundError after that.
void write_results(const RegisterOptions& options,
                   const CaseToRegister& registered,
                   const RunDescription& description,
                   const Communicator& world,
                   Registration& registration,
                   std::vector<RegistrationRecord>& records,
                   RunFolder& folder) {
  add_target_errors(registered, records);
  RegistrationRecord& best = records[best_record(records)];
  if (options.start == "search") set_rival(*registration.problem, records, best);
  registration.diagnose(best);
  warn_of(best.diagnosis.messages, world);
  warn_of_clipped(records, world);
  offer_search(options, best, registered.search_end, world);
  const Verdict verdict = judgement_of(best).verdict;
  const bool is_found = verdict != Verdict::NotFound;
  const RegistrationProblem& problem = *registration.problem;
  const std::filesystem::path slicer = options.output_folder / "slicer";
  // Before result.json: when that is there, everything is.
  if (is_found && description.has_pictures)
    write_slicer_folder(problem, best.result.room_from_ct, registered.study_case, slicer);
  else
    remove_slicer_files(problem, slicer);  // an earlier run's
  if (registered.landmarks.has_value())
    std::cout << residuals_text(*registered.landmarks, registered.study_case);
  std::cout << write_run(records, problem, description, options.output_folder);
  folder.finish();
  if (!is_found)
    throw NotFoundError("no pose was found (see the verdict); the results of the search are in " +
                        options.output_folder.string());
  if (options.is_found_required && verdict != Verdict::Found)
    throw NotFoundError(
        "the pose is doubtful (see the verdict), and --require-found is set; it is in " +
        options.output_folder.string());
}

}  // namespace

std::vector<RigidTransform> start_poses(const RegisterOptions& options,
                                        const PoseContext& context,
                                        std::vector<std::string>& notes) {
  check(context.frame.has_value(), "a start is relative to the case's nominal pose");
  if (!options.starts.empty()) return read_unbroken_poses(options.starts, context, &notes);
  if (!options.start_pose.empty()) return {read_pose(options.start_pose, context, &notes)};
  std::array<double, 6> values{};
  for (std::size_t i = 0; i < 3; ++i) {
    if (options.start_rotation_deg.has_value()) values[i] = (*options.start_rotation_deg)[i];
    if (options.start_translation_mm.has_value())
      values[i + 3] = (*options.start_translation_mm)[i];
  }
  return {
      pose_of_deg_and_mm(*context.frame, values, "--start-rotation-deg, --start-translation-mm")};
}

void run_registration(const RegisterOptions& typed,
                      const std::string& command_line,
                      const Communicator& world) {
  const RegistrationOptions method = method_of(typed, world);
  RunFolder folder({typed.output_folder, result_file_names(), typed.resume.restarts}, world);
  CaseToRegister registered = read_case(typed, world);
  RegisterOptions options = typed;
  options.renderer = renderer_of(typed, registered.study_case);
  if (options.renderer == "raycast" && options.renderer != typed.renderer && world.is_root())
    std::cout << kCastsWithoutFields;
  const auto pool = std::make_shared<ThreadPool>(thread_count(options.method.threads));
  LoadedCase loaded = load_problem(options, method, registered, pool, world);
  loaded.xray_readers.clear();  // no other X-rays follow
  const auto& problem = loaded.problem;
  find_starts(options, method, *problem, pool, world, registered);
  Registration registration = all_or_none(world, [&] {
    Registration made(problem, method, pool);
    made.examine_ends(options.uncertainty, pool);
    return made;
  });
  do_on_root(world, [&] {
    announce_outputs(options.output_folder, overlay_file_names(*problem));
    announce_outputs(options.output_folder / "slicer", slicer_file_names(*problem));
  });
  folder.open();

  RegisterOptions in_force = options.in_force();
  in_force.case_name = registered.study_case.name;
  const RunDescription description =
      description_of(in_force, registered, loaded, command_line, world);
  std::vector<RegistrationRecord> records = register_starts(
      registration,
      registered.starts,
      folder.unfinished("registrations",
                        deciding_values(deciding_options(in_force), description.provenance.inputs)),
      world);
  do_on_root(world, [&] {
    write_results(options, registered, description, world, registration, records, folder);
  });
}

std::vector<RegistrationRecord> register_starts(Registration& registration,
                                                std::span<const RigidTransform> starts,
                                                const UnfinishedWork& unfinished,
                                                const Communicator& communicator) {
  const auto run = [&](std::int64_t index) {
    return registration.run(starts[static_cast<std::size_t>(index)], index);
  };
  std::vector<RegistrationRecord> records;
  if (starts.empty()) return records;
  if (starts.size() == 1) {
    do_on_root(communicator, [&] { records.push_back(run(0)); });
    return records;
  }
  ResumableItems items(unfinished, communicator);
  std::vector<std::int64_t> all(starts.size());
  std::iota(all.begin(), all.end(), 0);
  items.complete(all, "registrations", [&](std::int64_t index) { return bytes_of(run(index)); });
  do_on_root(communicator, [&] { records = records_of(items, starts.size()); });
  return records;
}

}  // namespace af::registration
