// SPDX-License-Identifier: Apache-2.0
#include "evaluate/registration/evaluate_registrations.h"

#include <cmath>
#include <iostream>
#include <map>
#include <optional>
#include <set>
#include <span>

#include <CLI/CLI.hpp>

#include "base/error.h"
#include "base/toml_text.h"
#include "cli/app_main.h"
#include "cli/run_limits.h"
#include "evaluate/registration/case_evaluation.h"
#include "evaluate/registration/case_table.h"
#include "evaluate/registration/failure_traces.h"
#include "evaluate/registration/found_poses.h"
#include "evaluate/registration/loaded_methods.h"
#include "evaluate/registration/paired_statistics.h"
#include "evaluate/registration/registration_statistics.h"
#include "evaluate/report/evaluation_run.h"
#include "evaluate/report/report_program.h"
#include "evaluate/report/sample_summary_json.h"
#include "files/json_text.h"
#include "files/options_toml.h"
#include "files/output_file.h"
#include "files/sha256.h"
#include "files/shell_words.h"
#include "geometry/tre.h"
#include "ranks/root_only.h"
#include "ranks/run_folder.h"
#include "ranks/terminal.h"
#include "ranks/work_watch.h"
#include "register/case_loading.h"
#include "study/pose_file.h"
#include "study/shared_inputs.h"

namespace af::evaluation {
namespace {

using nlohmann::json;

/// What af-simulate left in a folder; null when it did not make it.
json simulation_in(const std::filesystem::path& folder) {
  const std::filesystem::path path = folder / "provenance.json";
  if (!std::filesystem::exists(path)) return nullptr;
  const std::string text = read_text_file(path);
  try {
    json provenance = json_of_text(text, path.string());
    if (provenance.is_object() && provenance.value("program", json()) == "af-simulate")
      return provenance;
  } catch (const FileError&) {  // from another program
  }
  return nullptr;
}

/// Options that the command for one start sets itself, or does not need.
const std::set<std::string> not_of_repeats = {"--case",
                                              "--renderer",
                                              "--starts-from",
                                              "--starts-per-interval",
                                              "--start-rule",
                                              "--starts-only",
                                              "--only-start",
                                              "--restart",
                                              "--no-lock",
                                              "--max-hours",
                                              "--stall-minutes",
                                              "--raycast-starts-per-interval",
                                              "--raycast-intervals",
                                              "--output"};

/// What af-report needs to make the command for one start. Null for another program's poses.
json repeat_json(const RegistrationStudyOptions& options) {
  if (!options.poses_from.empty()) return nullptr;
  const std::filesystem::path folder =
      std::filesystem::absolute(options.output_folder).lexically_normal();
  const std::string starts =
      options.start_rule == "search"
          ? " --start-rule search"
          : " --starts-from " + shell_quoted((folder / "starts.csv").string());
  return {{"command",
           "cd " + shell_quoted(std::filesystem::current_path().string()) + " && " +
               options.program + " registration" + options.shared_by_repeats + starts},
          {"renderer", options.renderer},
          {"output", (folder / "repeats").string()}};
}

/// How the study's X-rays were simulated, if they were: the provenance that af-simulate leaves
/// beside study.toml, or beside the X-rays when studies were joined. For a joined study it is the
/// provenance of the first case, with the commands of all cases.
json simulation_of(const Study& study) {
  if (json simulation = simulation_in(study.path.parent_path()); simulation.is_object())
    return simulation;
  json first;
  json commands = json::object();
  for (const StudyCase& study_case : study.cases) {
    const json simulation = simulation_in(study_case.views.front().xray.parent_path());
    if (!simulation.is_object()) continue;
    if (first.is_null()) first = simulation;
    commands[study_case.name] = simulation.value("command_line", "");
  }
  if (first.is_object()) first["commands_of_cases"] = commands;
  return first;
}

json point_json(const Eigen::Vector3d& point) {
  return {point.x(), point.y(), point.z()};
}

/// Adds what the rows' parameters are relative to, and the box over which distances are averaged.
void add_target(const CaseEvaluation& evaluation, const StudyCase& study_case, json& of_case) {
  of_case["gold_room_from_ct"] = pose_rows(evaluation.gold.room_from_ct);
  of_case["center_ct_mm"] = point_json(study_case.center_ct_mm);
  of_case["target_box_ct_mm"] = {point_json(study_case.target_box_ct.low_mm),
                                 point_json(study_case.target_box_ct.high_mm)};
}

json numbers_json(const std::vector<double>& values) {
  json result = json::array();
  for (const double value : values) result.push_back(number_json(value));
  return result;
}

json case_json(const CaseEvaluation& evaluation) {
  return {
      {"case", evaluation.case_name},
      {"gold", to_json(evaluation.gold)},
      {"starts", evaluation.start_count},
      {"draws", evaluation.starts.draws},
      {"inadmissible_draws", evaluation.starts.inadmissible_draws},
      {"inadmissible_draws_per_interval", evaluation.starts.inadmissible_per_interval},
      {"draws_beyond_last_interval", evaluation.starts.draws_beyond},
      {"draws_per_interval", evaluation.starts.draws_per_interval},
      {"rotation_share_per_interval", numbers_json(evaluation.starts.rotation_share_per_interval)}};
}

/// Warns of starts that do not cover all directions because the fields' range refused most draws.
std::vector<std::string> warnings_about_starts(const RegistrationStudyOptions& options,
                                               const CaseEvaluation& evaluation) {
  const StratifiedStarts& starts = evaluation.starts;
  std::string intervals;
  for (std::size_t k = 0; k < starts.draws_per_interval.size(); ++k) {
    const std::uint64_t draws = starts.draws_per_interval[k];
    const std::uint64_t refused = starts.inadmissible_per_interval[k];
    if (2 * refused <= draws) continue;
    const auto low_mm = static_cast<double>(k) * options.interval_width_mm;
    intervals += (intervals.empty() ? "" : ", ") + number_text(low_mm) + "-" +
                 number_text(low_mm + options.interval_width_mm) +
                 " mm: " + std::to_string(refused) + " of " + std::to_string(draws) +
                 " (share of rotation " + fixed_text(starts.rotation_share_per_interval[k], 2) +
                 ")";
  }
  if (intervals.empty()) return {};
  return {
      evaluation.case_name +
      ": most draws of some starts lay outside the fields' range and were refused, so that these "
      "starts cover directions unevenly (without refusals the share of rotation is 0.5): " +
      intervals};
}

/// How far the end poses of two rows lie apart, over the target points of their case.
EndDistance end_distance_of(const Study& study, const std::vector<CaseEvaluation>& evaluations) {
  std::map<std::string, Yardstick> yardsticks;
  for (const CaseEvaluation& evaluation : evaluations)
    yardsticks[evaluation.case_name] =
        yardstick_of(study, study.find_case(evaluation.case_name), evaluation.gold);
  return [yardsticks = std::move(yardsticks)](const RegistrationRow& a, const RegistrationRow& b) {
    const Yardstick& yardstick = yardsticks.at(a.case_name);
    return mean_tre_mm(yardstick.pose_of(a.final_deg_mm),
                       yardstick.pose_of(b.final_deg_mm),
                       yardstick.points_ct_mm);
  };
}

/// The gold standard's own error, to be shown beside every TRE: that of a case, and the mean over a
/// renderer's starts. null when a case's gold pose is a stated one.
void add_gold_uncertainty(const std::vector<CaseEvaluation>& evaluations, json& renderers) {
  std::map<std::string, double> own_mm;
  for (const CaseEvaluation& evaluation : evaluations)
    own_mm[evaluation.case_name] = own_tre_mm(evaluation.gold);
  for (json& renderer : renderers) {
    double sum_mm = 0.0;
    double starts = 0.0;
    for (json& entry : renderer["cases"]) {
      const double case_mm = own_mm.at(entry["case"].get<std::string>());
      entry["gold_uncertainty_mm"] = number_json(case_mm);
      sum_mm += case_mm * entry["starts"].get<double>();
      starts += entry["starts"].get<double>();
    }
    renderer["gold_uncertainty_mm"] = number_json(sum_mm / starts);
  }
}

json summary_json(const RegistrationStudyOptions& options,
                  const Study& study,
                  const std::vector<CaseEvaluation>& evaluations,
                  std::span<const RegistrationRow> rows) {
  json summary = summary_of_kind("registration");
  summary["study"] = study.path.string();
  summary["success_tre_mm"] = options.success_tre_mm;
  summary["start_rule"] = options.starts_from.empty() ? options.start_rule : "given";
  const registration::RegistrationOptions method = registration::resolve(options.method);
  summary["method"] = {
      {"preset", options.method.chains.empty() ? options.method.preset_name() : "chain"},
      {"similarity", method.similarity_list()},
      {"optimizer", method.optimizer_list()}};
  if (options.correction.is_wanted) summary["method"]["corrected"] = true;
  summary["simulation"] = simulation_of(study);
  summary["cases"] = json::array();
  summary["pictures"] = json::array();
  for (const CaseEvaluation& evaluation : evaluations) {
    summary["cases"].push_back(case_json(evaluation));
    const StudyCase& study_case = study.find_case(evaluation.case_name);
    add_target(evaluation, study_case, summary["cases"].back());
    summary["cases"].back()["views"] = study_case.views.size();
    for (const json& picture : evaluation.pictures) summary["pictures"].push_back(picture);
  }
  summary["renderers"] = json::array();
  for (const std::string& renderer : options.renderers())
    summary["renderers"].push_back(renderer_statistics(rows,
                                                       renderer,
                                                       {options.intervals,
                                                        options.interval_width_mm,
                                                        options.method.seed,
                                                        options.success_tre_mm}));
  add_gold_uncertainty(evaluations, summary["renderers"]);
  std::vector<std::string> found = row_problems(rows);
  for (const CaseEvaluation& evaluation : evaluations)
    found.insert(found.end(), evaluation.pose_problems.begin(), evaluation.pose_problems.end());
  if (!options.poses_from.empty()) {
    std::set<std::string> known;
    for (const StudyCase& study_case : study.cases) known.insert(study_case.name);
    for (const std::string& text : unknown_case_problems(options.poses_from, known))
      found.push_back(text);
  }
  summary["row_problems"] = found;
  std::vector<std::string> case_names;
  for (const CaseEvaluation& evaluation : evaluations) case_names.push_back(evaluation.case_name);
  summary["warnings"] = warnings_about_patients(patient_count(case_names));
  for (const CaseEvaluation& evaluation : evaluations)
    for (const std::string& text : warnings_about_starts(options, evaluation))
      summary["warnings"].push_back(text);
  summary["field_against_raycast"] = paired_statistics(rows,
                                                       {options.equivalence_margin_mm,
                                                        options.method.seed,
                                                        options.success_tre_mm,
                                                        end_distance_of(study, evaluations)});
  summary["figures"] = {"success-rate", "tre-histogram", "tre-scatter"};
  summary["repeat"] = repeat_json(options);
  if (options.only_start.has_value()) summary["only_start"] = *options.only_start;
  return summary;
}

void write_traces(const std::filesystem::path& folder,
                  const std::vector<CaseEvaluation>& evaluations) {
  // Traces of an earlier run would be taken for this run's.
  std::filesystem::remove_all(folder / "traces");
  for (const CaseEvaluation& evaluation : evaluations)
    for (const auto& [renderer, traces] : evaluation.traces)
      for (const auto& [start_index, trace] : traces) {
        make_folder(folder / "traces");
        write_text_file(folder / trace_file(evaluation.case_name, renderer, start_index),
                        trace_table(trace).to_text());
      }
}

/// The mean error of successes beside the gold standard's own, and how far successes of one view
/// lie from the truth in depth. Empty without a success.
std::string mean_text(const json& renderer) {
  const double mean_mm = number_of(renderer["error_of_successes_mm"]["mean"]);
  const double gold_mm = number_of(renderer["gold_uncertainty_mm"]);
  const json& depth_mm = renderer["depth_of_successes_mm"];
  if (!std::isfinite(mean_mm)) return "";
  std::string text = ", mean " + renderer["error"].get<std::string>() + " of these " +
                     fixed_text(mean_mm, 2) + " mm";
  if (std::isfinite(gold_mm))
    text += " (gold standard by itself: " + fixed_text(gold_mm, 2) + " mm)";
  if (depth_mm["count"] != 0)
    text += ", depth off by " + fixed_text(number_of(depth_mm["median"]), 2) + " mm (median), " +
            fixed_text(number_of(depth_mm["p95"]), 2) + " mm (95th percentile)";
  return text;
}

void print_outcome(const json& summary,
                   const std::filesystem::path& folder,
                   const Communicator& world) {
  for (const json& renderer : summary["renderers"]) {
    std::cout << renderer["renderer"].get<std::string>() << ": "
              << renderer["successes"].get<std::int64_t>() << " of "
              << renderer["starts"].get<std::int64_t>() << " starts succeeded ("
              << renderer["error"].get<std::string>() << " < "
              << number_text(number_of(summary["success_tre_mm"])) << " mm)";
    std::cout << mean_text(renderer);
    const double seconds = number_of(renderer["seconds"]["median"]);
    if (std::isfinite(seconds))
      std::cout << ", median " << fixed_text(1000.0 * seconds, 1) << " ms each";
    std::cout << '\n';
  }
  for (const json& warning : summary["warnings"]) warn(world, warning.get<std::string>());
  for (const json& problem : summary["row_problems"])
    std::cout << "problem: " << problem.get<std::string>() << '\n';
  std::cout << "results: " << folder.string() << '\n';
}

std::vector<StudyCase> chosen_cases(const RegistrationStudyOptions& options, const Study& study) {
  std::vector<StudyCase> cases;
  for (const StudyCase* study_case : study.chosen_cases(options.cases))
    cases.push_back(*study_case);
  if (cases.size() > 1 && !options.fields.texts.empty())
    throw InputError("--field",
                     options.fields.texts.front(),
                     "a field belongs to one CT: with several cases put the key `field` into the "
                     "study, or choose one by --case",
                     study.path.string());
  // A case without a gold pose must not cost the registrations of those before it.
  for (const StudyCase& study_case : cases) require_gold(study, study_case, options.gold);
  return cases;
}

}  // namespace

std::vector<std::string> RegistrationStudyOptions::renderers() const {
  if (!poses_from.empty()) return {method_name};
  return chosen_renderers();
}

std::vector<std::string> problems(const RegistrationStudyOptions& options) {
  std::vector<std::string> found = problems(options.start_options());
  append_problems(options, found);
  for (const std::string& text :
       options.start_rule == "search"
           ? problems(options.search)
           : problems_without_search(options.search, "--start-rule search"))
    found.push_back(text);
  if (options.start_rule == "search" && !options.starts_from.empty())
    found.emplace_back("--start-rule = search: must not be given with --starts-from");
  for (const std::string& text : field_problems(options)) found.push_back(text);
  const auto require_part = [&](const char* name, const std::optional<int>& part, int whole) {
    if (part.has_value() && !(*part >= 1 && *part <= whole))
      found.push_back(std::string(name) + " = " + std::to_string(*part) + ": must be from 1 to " +
                      std::to_string(whole));
    if (part.has_value() && options.renderer != "both")
      found.push_back(std::string(name) + " = " + std::to_string(*part) +
                      ": must not be given without --renderer both");
  };
  require_part("--raycast-starts-per-interval",
               options.raycast_starts_per_interval,
               options.starts_per_interval);
  require_part("--raycast-intervals", options.raycast_intervals, options.intervals);
  if (!options.poses_from.empty() && options.starts_from.empty())
    found.push_back("--poses-from = '" + options.poses_from.string() +
                    "': needs --starts-from, the starts.csv that the poses were found from");
  if (options.correction.is_wanted && options.renderer == "raycast")
    found.emplace_back(registration::kCorrectsRayCasting);
  if (options.correction.is_wanted && !options.poses_from.empty())
    found.emplace_back(
        "--correct = set: must not be given with --poses-from, which registers nothing");
  if (options.poses_from.empty() && options.method_name != RegistrationStudyOptions{}.method_name)
    found.push_back("--method-name = '" + options.method_name +
                    "': must not be given without --poses-from");
  return found;
}

namespace {

void describe_starts(Fields& field, RegistrationStudyOptions& options) {
  field("case", options.cases, "Case of the study, may be repeated (default: all)");
  field(
      "starts_per_interval", options.starts_per_interval, "Starts in each interval of initial TRE");
  field("intervals", options.intervals, "Number of intervals of initial TRE, from 0 mm");
  field("interval_width_mm", options.interval_width_mm, "Width of an interval, mm");
  field("start_rule",
        options.start_rule,
        "Where starts are drawn: stratified, equally many per interval, as in the paper; uniform "
        "over all intervals; within-range, equally many per interval inside the fields' motion "
        "range; or search: one registration per case, which looks for its starts itself")
      .choice({"stratified", "uniform", "within-range", "search"});
  field.part(options.search);
  field("starts_from",
        options.starts_from,
        "starts.csv instead of drawn starts: case, and m00 ... m23 of room_from_ct or start_rx_deg "
        "... start_tz_mm relative to gold")
      .input();
  field("starts_only",
        options.is_starts_only,
        "Write starts.csv, for other programs, and register nothing")
      .not_recorded("without registrations nothing records options");
  field.part(options.pictures);
  field("only_start",
        options.only_start,
        "Register from this start_index of starts.csv alone, to repeat one row of a run")
      .at_least(0);
}

void describe_methods(Fields& field, RegistrationStudyOptions& options) {
  field("poses_from",
        options.poses_from,
        "Evaluate poses that another program found from --starts-from: CSV of start_index, [case, "
        "seconds] and a pose (docs/poses.md), or a folder of [CASE-]INDEX.tfm");
  field("method_name", options.method_name, "With --poses-from: what to call them")
      .of_form("letters, digits, blanks and . _ + - only", [](const std::string& name) {
        return !name.empty() && name.find_first_not_of(
                                    "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ"
                                    "0123456789 ._+-") == std::string::npos;
      });
  field("raycast_starts_per_interval",
        options.raycast_starts_per_interval,
        "With --renderer both: this many of each interval's starts also by ray casting (default: "
        "all)");
  field("raycast_intervals",
        options.raycast_intervals,
        "With --renderer both: ray casting only in this many first intervals (default: all)");
  field("equivalence_margin_mm",
        options.equivalence_margin_mm,
        "Field and ray casting are equivalent when their ends are this near on average over "
        "patients, mm")
      .above(0.0)
      .finite()
      .not_deciding("rows do not depend on it");
  field("success_tre_mm",
        options.success_tre_mm,
        "A registration that ends below this TRE, with one view below this mRPD, succeeded, mm")
      .above(0.0)
      .finite();
}

}  // namespace

void RegistrationStudyOptions::describe(Fields& field) {
  field.part<MethodOptions>(*this);
  field.part(correction);
  field.part(uncertainty);
  describe_starts(field, *this);
  describe_methods(field, *this);
  field.at("seed").as("--seed", "Seed of the starts, and of what cma-es draws");
  field.part(resume);
  field("output", output_folder, "Folder for the results")
      .as("-o,--output")
      .required()
      .not_deciding("results are the same");
  field.leave_out(program, "main() knows it");
  field.leave_out(shared_by_repeats, "the options as typed");
}

RegistrationStudyOptions RegistrationStudyOptions::in_force() const {
  RegistrationStudyOptions options = *this;
  options.method = method.in_force();
  if (poses_from.empty()) options.method_name.clear();
  if (renderer == "both") {
    options.raycast_starts_per_interval = raycast_starts_per_interval.value_or(starts_per_interval);
    options.raycast_intervals = raycast_intervals.value_or(intervals);
  }
  return options;
}

namespace {

void run_registration(const RegistrationStudyOptions& options,
                      const std::string& command_line,
                      const Communicator& world) {
  const std::filesystem::path& folder = options.output_folder;
  all_or_none(world, [&] { throw_if_any(problems(options)); });
  RunFolder run({folder,
                 {"starts.csv",
                  "registrations.csv",
                  "cases.csv",
                  "starts-per-interval.csv",
                  "reproduce.sh",
                  "summary.json"},
                 options.resume.restarts},
                world);
  const Shared<Study> study = shared_study(options.study, world);
  const std::vector<StudyCase> cases =
      all_or_none(world, [&] { return chosen_cases(options, study); });
  run.open();
  auto starts_file = on_root(world, [&] { return StartsFile(folder / "starts.csv"); }).confirmed();

  std::vector<RegistrationRow> rows;
  std::size_t start_count = 0;
  std::vector<CaseEvaluation> evaluations;
  const auto kept_fields = std::make_shared<registration::KeptFields>(cases);
  for (const StudyCase& study_case : cases) {
    const auto on_starts = [&](const CaseEvaluation& so_far) {
      start_count += so_far.starts.starts.size();
      if (start_count > kMostStarts)
        throw InputError("starts = " + std::to_string(start_count) + ": a run takes at most " +
                         std::to_string(kMostStarts));
      run.begin_results();
      starts_file.value().add(so_far.case_name, so_far.starts.starts.view());
      if (evaluations.size() + 1 == cases.size()) starts_file.value().finish();
    };
    CaseEvaluation evaluation;
    if (options.poses_from.empty())
      evaluation =
          evaluate_case(options, study, study_case, run, kept_fields, world, on_starts, rows);
    else
      do_on_root(world, [&] {
        evaluation = evaluate_found_poses(options, study, study_case, on_starts, rows);
      });
    evaluations.push_back(std::move(evaluation));
  }
  if (options.is_starts_only) {
    if (world.is_root()) std::cout << "starts: " << (folder / "starts.csv").string() << '\n';
    return;
  }
  do_on_root(world, [&] {
    const WorkNote note("writing the results", WorkNote::Kind::Phase);
    Provenance provenance = {"af-evaluate registration",
                             command_line,
                             to_toml(options),
                             options.method.seed,
                             world.size(),
                             {{"study", sha256_of_file(study->path.string())}}};
    for (const CaseEvaluation& evaluation : evaluations) {
      provenance.inputs.insert(evaluation.inputs.identities.begin(),
                               evaluation.inputs.identities.end());
      provenance.input_notes.insert(evaluation.inputs.notes.begin(), evaluation.inputs.notes.end());
    }
    write_registrations(folder / "registrations.csv", rows, options.success_tre_mm);
    write_traces(folder, evaluations);
    const json summary = summary_json(options, study, evaluations, rows);
    write_text_file(folder / "cases.csv", case_table(summary["renderers"]).to_text());
    write_text_file(folder / "starts-per-interval.csv",
                    drawn_starts_table(summary["cases"], summary["renderers"]).to_text());
    run.finish(summary, provenance);
    print_outcome(summary, folder, world);
    if (!options.pictures.are_left_out) draw_results({folder.string()}, world);
  });
}

}  // namespace

cli::SubCommand registration_command(CLI::App& app, const std::string& program) {
  auto options = std::make_shared<RegistrationStudyOptions>();
  options->program = program;
  cli::SubCommand command = cli::sub_command(app,
                                             "registration",
                                             "Registers a study's cases from starts at stated "
                                             "distances from the gold pose, for TRE and success",
                                             run_registration,
                                             options);
  cli::bind_run_limits(*command.app);
  command.app->parse_complete_callback([options, app = command.app] {
    options->shared_by_repeats = cli::given_options(*app, not_of_repeats);
  });
  return command;
}

}  // namespace af::evaluation
