// SPDX-License-Identifier: Apache-2.0
#include "evaluate/sweeps/sweep_field_parameters.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <iostream>
#include <memory>
#include <optional>
#include <set>

#include "base/error.h"
#include "drr/ray_cast_drr.h"
#include "drr/two_pass_af_drr.h"
#include "evaluate/image_quality/image_quality_tables.h"
#include "evaluate/report/evaluation_run.h"
#include "evaluate/report/report_program.h"
#include "evaluate/report/row_gathering.h"
#include "evaluate/sweeps/difference_images.h"
#include "evaluate/sweeps/field_parameter_tables.h"
#include "field/field_reading.h"
#include "files/csv_table.h"
#include "files/options_toml.h"
#include "files/output_file.h"
#include "files/resource_check.h"
#include "precompute/precompute_field.h"
#include "ranks/progress_printer.h"
#include "ranks/root_only.h"
#include "ranks/run_folder.h"
#include "ranks/terminal.h"
#include "register/case_loading.h"
#include "study/node_ct.h"
#include "study/study_file.h"

namespace af::evaluation {
namespace {

using nlohmann::json;

constexpr const char* kComparisonStage = "comparison";

/// Settings of a sweep, each once, in the order of sweeps, with the base setting first.
std::vector<PrecomputeOptions> settings_of(const FieldParametersOptions& options,
                                           const PrecomputeOptions& stated) {
  const PrecomputeOptions base = stated.in_force();
  std::vector<PrecomputeOptions> settings = {base};
  const auto add = [&](const auto& values, auto member) {
    for (const auto value : values) {
      PrecomputeOptions setting = base;
      setting.*member = value;
      const bool is_base = setting.*member == base.*member;
      if (!is_base) settings.push_back(setting);
    }
  };
  add(options.uv_nodes, &PrecomputeOptions::uv_nodes);
  add(options.st_nodes, &PrecomputeOptions::st_nodes);
  add(options.codewords, &PrecomputeOptions::codewords);
  add(options.training_fractions, &PrecomputeOptions::training_fraction);
  return settings;
}

std::string field_name(const PrecomputeOptions& setting) {
  return (setting.case_name.empty() ? "" : setting.case_name + "-") + setting.camera + "-uv" +
         std::to_string(setting.design().uv_nodes) + "-st" +
         std::to_string(setting.design().st_nodes) + "-n" +
         std::to_string(setting.design().codewords) + "-t" + number_text(training_share(setting)) +
         ".af.h5";
}

/// The options of a field, without where it goes.
OptionTexts options_of_field(const std::string& toml) {
  OptionTexts options = option_texts(toml);
  options.erase("output");
  return options;
}

/// Collective. The field of a setting, which is made unless it exists. Throws FileError when one of
/// that name was made with other options.
std::shared_ptr<const CompressedAttenuationField> field_of(const PrecomputeOptions& setting,
                                                           const std::string& command_line,
                                                           const Communicator& world,
                                                           FieldFileInfo& info) {
  const bool exists =
      on_root(world, [&] { return std::filesystem::exists(setting.output); }).share();
  if (!exists) run_precompute(setting, command_line, world);
  auto field = read_field(setting.output, world, &info);
  all_or_none(world, [&] {
    const std::string expected = to_toml(setting);
    const std::string& found = info.provenance.options_toml;
    if (options_of_field(found) != options_of_field(expected))
      throw FileError(setting.output, "options of the field to reuse", expected, found);
  });
  return field;
}

/// Collective. Comparisons at the same random poses for every setting.
std::vector<DrrComparison> compare(const FieldParametersOptions& options,
                                   const std::shared_ptr<const CompressedAttenuationField>& field,
                                   const RayCastDrr& reference,
                                   const UnfinishedWork& unfinished,
                                   const Communicator& world) {
  const TwoPassAfDrr tested(field);
  DrrComparer comparer(tested, reference, View::whole_detector(field->identity.camera));
  all_or_none(world, [&] {
    require_memory(
        "--pose-count",
        static_cast<double>(options.pose_count) * static_cast<double>(sizeof(DrrComparison)));
  });
  return collected_rows<DrrComparison>(
      world, unfinished, options.pose_count, "", [&](std::int64_t index) {
        return comparer.at_random_pose(field->identity.frame,
                                       field->identity.range,
                                       options.seed,
                                       static_cast<std::uint64_t>(index));
      });
}

void write_results(const FieldParametersOptions& options,
                   const std::vector<SettingResult>& results,
                   const json& difference_images,
                   const RunFolder& run,
                   const Provenance& provenance) {
  const std::filesystem::path& folder = options.output_folder;
  run.begin_results();
  json summary = write_sweep(results, folder);
  summary.update(summary_of_kind("field-parameters"));
  summary["difference_images"] = difference_images;
  run.finish(std::move(summary), provenance);
  std::cout << sweep_text(results) << "results: " << folder.string() << '\n';
}

/// One camera of a CT, with the base setting, and where its CT lies.
struct Target {
  PrecomputeOptions base;
  std::string ct_path;
};

/// The named camera, or all views of the study's chosen cases.
std::vector<Target> targets_of(const FieldParametersOptions& options) {
  const PrecomputeOptions& base = options.base;
  if (!base.ct.empty()) return {{base, base.ct}};
  const Study study = read_study(base.study);
  const auto target_of = [&](const StudyCase& study_case) {
    Target target{base, study_case.ct.string()};
    target.base.ct_reading = study_case.ct_reading;
    return target;
  };
  if (!base.camera.empty()) return {target_of(study.find_case(base.case_name))};
  std::vector<std::string> names;
  if (!base.case_name.empty()) names.push_back(base.case_name);
  std::vector<Target> targets;
  for (const StudyCase* study_case : study.chosen_cases(names))
    for (const StudyView& view : study_case->views) {
      Target& target = targets.emplace_back(target_of(*study_case));
      target.base.case_name = study_case->name;
      target.base.camera = view.camera;
    }
  return targets;
}

/// The cost of a setting relative to others: how many rays its field has.
double rays_of(const PrecomputeOptions& setting) {
  return std::pow(static_cast<double>(setting.design().uv_nodes) * setting.design().st_nodes, 2.0);
}

/// Says how long the settings after the first will take. It scales the time of the first one:
/// fields by their rays, comparisons as they are.
void announce_rest(const std::vector<PrecomputeOptions>& settings,
                   double field_seconds,
                   double comparison_seconds,
                   const Communicator& world) {
  if (settings.size() < 2) return;
  double seconds = 0.0;
  for (std::size_t i = 1; i < settings.size(); ++i)
    seconds +=
        comparison_seconds + (std::filesystem::exists(settings[i].output)
                                  ? 0.0
                                  : field_seconds * rays_of(settings[i]) / rays_of(settings[0]));
  inform(world,
         "after the first field " + std::to_string(settings.size() - 1) + " more, about " +
             duration_text(seconds));
}

/// Collective. Every setting's field for one target, made or reused, and its comparisons.
void sweep_target(const FieldParametersOptions& options,
                  const Target& target,
                  const std::filesystem::path& fields,
                  const std::string& command_line,
                  const RunFolder& run,
                  const Communicator& world,
                  std::vector<SettingResult>& results,
                  Provenance& provenance) {
  std::vector<std::string> warnings;
  const NodeCt ct = read_ct_per_node(
      target.ct_path, target.base.ct_reading, target.base.attenuation, world, warnings);
  for (const std::string& text : warnings) warn(world, text);
  const RayCastDrr reference(ct.volume, options.reference);
  std::vector<PrecomputeOptions> settings = settings_of(options, target.base);
  for (PrecomputeOptions& setting : settings) {
    setting.output = (fields / field_name(setting)).string();
    setting.is_restart = options.resume.restarts;
  }
  using Clock = std::chrono::steady_clock;
  for (std::size_t i = 0; i < settings.size(); ++i) {
    const PrecomputeOptions& setting = settings[i];
    const bool is_made = !std::filesystem::exists(setting.output);
    const Clock::time_point start = Clock::now();
    SettingResult& result = results.emplace_back();
    result.setting = setting;
    const auto field = field_of(setting, command_line, world, result.info);
    all_or_none(world, [&] {
      require_same_ct(setting.output, ct.facts.identity, target.ct_path, field->identity.ct);
    });
    result.field = field_description(field->identity, field->light_slab, field->codebook.size());
    result.uncompressed_bytes = uncompressed_bytes_of(setting);
    read_creation(result);
    const Clock::time_point compared = Clock::now();
    const DecidingValues decides =
        deciding_values(deciding_options(options, kComparisonStage),
                        {{"the field", result.info.payload_sha256}, {"the CT", ct.facts.identity}});
    result.comparisons =
        compare(options, field, reference, run.unfinished(field_name(setting), decides), world);
    if (is_made && i == 0)
      announce_rest(settings,
                    std::chrono::duration<double>(compared - start).count(),
                    std::chrono::duration<double>(Clock::now() - compared).count(),
                    world);
    provenance.inputs["field " + field_name(setting)] = result.info.payload_sha256;
  }
  provenance.inputs["ct " + results.back().target()] = ct.facts.identity;
}

}  // namespace

std::vector<std::string> problems(const FieldParametersOptions& options) {
  std::vector<std::string> found;
  std::set<std::string> distinct;
  for (const PrecomputeOptions& setting : settings_of(options, options.base))
    for (const std::string& text : af::problems(setting))
      if (distinct.insert(text).second) found.push_back(text);
  if (options.base.camera.empty() && options.base.study.empty())
    found.emplace_back("--camera = '': must name a camera");
  if (options.base.ct.empty() == options.base.study.empty())
    found.emplace_back("--ct or --study: exactly one must be given");
  for (const std::string& text : field_problems(options))
    if (distinct.insert(text).second) found.push_back(text);
  return found;
}

namespace {

/// The setting that all sweeps share. It has few of the options of af-precompute, some with other
/// names.
void describe_base(Fields& field, PrecomputeOptions& base) {
  const char* const why = "the sweeps have the defaults of af-precompute";
  field.part(base);
  field.without_options(why);
  for (const char* name : {"output", "restart", "dry_run"}) field.at(name).not_recorded(why);
  field.at("ct").as("--ct");
  CtReadOptions reading;
  for (const Field& part : fields_of(reading)) field.at(part.name).as(part.option);
  field.at("rig").as("--rig");
  field.at("study")
      .as("--study", "study.toml that names CT, rig and pose instead")
      .excludes({"--ct"});
  field.at("case")
      .as("--case", "Case of the study (default: its only one; without --camera all)")
      .needs({});
  field.at("camera").as("--camera",
                        "Camera of the rig (default with --study: all views, their DRRs pooled as "
                        "in the paper)");
  field.at("max_rotation_deg").as("--max-rotation-deg", "Range of every field, degrees");
  field.at("max_translation_mm").as("--max-translation-mm", "Range of every field, mm");
  field.at("slabs").as("--slabs", "Depth slabs of every field [1]");
  field.at("uv_nodes").as("--base-uv-nodes", "(u,v) nodes while others vary [64]");
  field.at("st_nodes").as("--base-st-nodes", "(s,t) nodes while others vary [256]");
  field.at("codewords").as("--base-codewords", "Codewords while others vary [16384]");
}

}  // namespace

void FieldParametersOptions::describe(Fields& field) {
  describe_base(field, base);
  const auto sweep = [&](const std::string& what, auto& values, const std::string& help) {
    std::string option = "--" + what;
    std::replace(option.begin(), option.end(), '_', '-');
    field("sweep_" + what, values, "Comma-separated: " + help).as(option).comma_separated();
  };
  sweep("uv_nodes", uv_nodes, "(u,v) nodes per side to try");
  sweep("st_nodes", st_nodes, "(s,t) nodes per side to try");
  sweep("codewords", codewords, "codebook sizes to try");
  sweep("training_fraction", training_fractions, "training shares to try");
  field("pose_count", pose_count, "Random poses, the same for every field")
      .at_least(1)
      .decides(kComparisonStage);
  field.part(reference);
  field.last()
      .as("--step-mm", "Longest step of the reference DRRs, mm")
      .decides(kComparisonStage)
      .name = "drr_step_mm";
  field("pose_seed", seed, "Seed of the random poses").as("--seed").decides(kComparisonStage);
  field("fields", fields_folder, "Where fields are kept and looked for (default: OUTPUT/fields)")
      .not_deciding("a field that is there is the one to make");
  field.part(resume);
  field("output", output_folder, "Folder for the results")
      .as("-o,--output")
      .required()
      .not_deciding("results are the same");
}

FieldParametersOptions FieldParametersOptions::in_force() const {
  FieldParametersOptions options = *this;
  options.base = base.in_force();
  return options;
}

namespace {

void run_field_parameters(const FieldParametersOptions& options,
                          const std::string& command_line,
                          const Communicator& world) {
  const std::filesystem::path fields =
      options.fields_folder.empty() ? options.output_folder / "fields" : options.fields_folder;
  all_or_none(world, [&] { throw_if_any(problems(options)); });
  RunFolder run({options.output_folder, {"reproduce.sh", "summary.json"}, options.resume.restarts},
                world);
  run.open();
  do_on_root(world, [&] { make_folder(fields); });
  const std::vector<Target> targets = all_or_none(world, [&] { return targets_of(options); });
  Provenance provenance = {"af-evaluate field-parameters",
                           command_line,
                           to_toml(options),
                           options.seed,
                           world.size(),
                           {}};
  std::vector<SettingResult> results;
  for (const Target& target : targets)
    sweep_target(options, target, fields, command_line, run, world, results, provenance);
  const json difference_images =
      write_difference_images(results, options.reference.step_mm, options.output_folder, world);
  do_on_root(world, [&] {
    write_results(options, results, difference_images, run, provenance);
    draw_results({options.output_folder.string()}, world);
  });
}

}  // namespace

cli::SubCommand field_parameters_command(CLI::App& app) {
  auto options = std::make_shared<FieldParametersOptions>();
  PrecomputeOptions& base = options->base;
  base.max_translation_mm = 30.0;
  base.preset = "paper";
  base.training_fraction = 0.1;  // the paper's
  cli::SubCommand command =
      cli::sub_command(app,
                       "field-parameters",
                       "PSNR, memory, time and compression of a camera's fields against each of "
                       "four parameters; builds missing fields",
                       run_field_parameters,
                       options);
  cli::bind_run_limits(*command.app);
  return command;
}

}  // namespace af::evaluation
