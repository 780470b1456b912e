// SPDX-License-Identifier: Apache-2.0
#include "evaluate/field_parameters_command.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <iostream>
#include <memory>
#include <set>
#include <sstream>

#include "base/error.h"
#include "cli/app_main.h"
#include "cli/progress_printer.h"
#include "drr/ray_cast_drr.h"
#include "drr/two_pass_af_drr.h"
#include "evaluate/figure_files.h"
#include "evaluate/image_quality_files.h"
#include "evaluate/row_gathering_program.h"
#include "evaluate/summary_files.h"
#include "io/csv_table.h"
#include "io/field_file.h"
#include "io/gnuplot_figure.h"
#include "io/node_ct.h"
#include "io/output_file.h"
#include "io/provenance.h"
#include "io/study_file.h"
#include "parallel/work_queue.h"
#include "precompute/precompute_program.h"
#include "register/case_loading.h"

namespace af::evaluation {
namespace {

using nlohmann::json;

/// Settings of a sweep, each once, in the order of sweeps; the base setting first.
std::vector<PrecomputeOptions> settings_of(const FieldParametersOptions& options) {
  std::vector<PrecomputeOptions> settings = {options.base};
  const auto add = [&](const auto& values, auto member) {
    for (const auto value : values) {
      PrecomputeOptions setting = options.base;
      setting.*member = value;
      const bool is_base = setting.*member == options.base.*member;
      if (!is_base) settings.push_back(setting);
    }
  };
  add(options.uv_nodes, &PrecomputeOptions::uv_nodes);
  add(options.st_nodes, &PrecomputeOptions::st_nodes);
  add(options.codewords, &PrecomputeOptions::codewords);
  add(options.training_fractions, &PrecomputeOptions::training_fraction);
  return settings;
}

/// Of the tiles: sweeps always state it.
double training_share(const PrecomputeOptions& setting) {
  return setting.training_fraction.value();
}

std::string field_name(const PrecomputeOptions& setting) {
  return setting.camera + "-uv" + std::to_string(setting.uv_nodes) + "-st" +
         std::to_string(setting.st_nodes) + "-n" + std::to_string(setting.codewords) + "-t" +
         number_text(training_share(setting)) + ".af.h5";
}

/// What decides a field's content, without where it goes.
std::string deciding_options(const std::string& toml) {
  std::string result;
  std::istringstream lines(toml);
  for (std::string line; std::getline(lines, line);)
    if (!line.starts_with("output =")) result += line + "\n";
  return result;
}

/// One field and how its DRRs compare.
struct SettingResult {
  PrecomputeOptions setting;
  FieldFileInfo info;
  json field;
  double creation_seconds = 0.0;
  int creation_ranks = 0;
  std::uint64_t uncompressed_bytes = 0;
  std::vector<DrrComparison> comparisons;  ///< rank 0
};

/// All samples of the uncropped planes at 16 bits, what the paper calls the uncompressed field.
std::uint64_t uncompressed_bytes_of(const PrecomputeOptions& setting) {
  const auto square = [](int nodes) {
    return static_cast<std::uint64_t>(nodes) * static_cast<std::uint64_t>(nodes);
  };
  return 2 * static_cast<std::uint64_t>(setting.slabs) * square(setting.uv_nodes) *
         square(setting.st_nodes);
}

void read_creation(const FieldFileInfo& info, SettingResult& result) {
  const json provenance = json::parse(info.provenance.provenance_json, nullptr, false);
  if (!provenance.is_object() || !provenance.contains("seconds")) return;
  for (const auto& [phase, seconds] : provenance.at("seconds").items())
    result.creation_seconds += seconds.get<double>();
  result.creation_ranks = provenance.value("rank_count", 0);
}

/// Collective. The field of a setting, made unless it is there. FileError when one of that name was
/// made with other options.
std::shared_ptr<const CompressedAttenuationField> field_of(const PrecomputeOptions& setting,
                                                           const std::string& command_line,
                                                           const Communicator& world,
                                                           FieldFileInfo& info) {
  const bool exists = all_or_none(world, [&] { return std::filesystem::exists(setting.output); });
  if (!exists) run_precompute(setting, command_line, world);
  const auto field = read_field(setting.output, world, &info);
  all_or_none(world, [&] {
    const std::string expected = deciding_options(to_toml(setting));
    const std::string found = deciding_options(info.provenance.options_toml);
    if (found != expected)
      throw FileError(setting.output, "options of the field to reuse", expected, found);
  });
  return field;
}

/// Collective. Comparisons at the same random poses for every setting.
std::vector<DrrComparison> compare(const FieldParametersOptions& options,
                                   const std::shared_ptr<const CompressedAttenuationField>& field,
                                   const RayCastDrr& reference,
                                   const Communicator& world) {
  const TwoPassAfDrr tested(field);
  DrrComparer comparer(tested, reference, View::whole_detector(field->identity.camera));
  std::vector<json> mine;
  for_each_item(world, options.pose_count, [&](std::int64_t index) {
    mine.push_back(comparison_row(index,
                                  comparer.at_random_pose(field->identity.frame,
                                                          field->identity.range,
                                                          options.seed,
                                                          static_cast<std::uint64_t>(index))));
  });
  std::vector<DrrComparison> comparisons;
  for (const json& row : gather_rows(world, mine)) comparisons.push_back(comparison_of(row));
  return comparisons;
}

SampleSummary psnr_of(const SettingResult& result) {
  std::vector<double> values;
  for (const DrrComparison& comparison : result.comparisons)
    if (!std::isnan(comparison.psnr_db)) values.push_back(comparison.psnr_db);
  return summarize(values);
}

CsvTable settings_table(const std::vector<SettingResult>& results) {
  CsvTable table({"uv_nodes",
                  "st_nodes",
                  "codewords",
                  "training_fraction",
                  "slabs",
                  "psnr_median_db",
                  "psnr_q1_db",
                  "psnr_q3_db",
                  "psnr_p5_db",
                  "psnr_min_db",
                  "uncompressed_bytes",
                  "payload_bytes",
                  "file_bytes",
                  "payload_compression",
                  "file_compression",
                  "creation_ranks",
                  "creation_seconds"});
  for (const SettingResult& result : results) {
    const SampleSummary psnr = psnr_of(result);
    const auto uncompressed = static_cast<double>(result.uncompressed_bytes);
    table.add_row({std::to_string(result.setting.uv_nodes),
                   std::to_string(result.setting.st_nodes),
                   std::to_string(result.setting.codewords),
                   number_text(training_share(result.setting)),
                   std::to_string(result.setting.slabs),
                   number_text(psnr.median),
                   number_text(psnr.lower_quartile),
                   number_text(psnr.upper_quartile),
                   number_text(psnr.percentile_5),
                   number_text(psnr.minimum),
                   std::to_string(result.uncompressed_bytes),
                   std::to_string(result.info.payload_bytes),
                   std::to_string(result.info.file_bytes),
                   number_text(uncompressed / static_cast<double>(result.info.payload_bytes)),
                   number_text(uncompressed / static_cast<double>(result.info.file_bytes)),
                   std::to_string(result.creation_ranks),
                   number_text(result.creation_seconds)});
  }
  return table;
}

CsvTable poses_table(const std::vector<SettingResult>& results) {
  CsvTable table(
      {"uv_nodes", "st_nodes", "codewords", "training_fraction", "pose_index", "psnr_db"});
  for (const SettingResult& result : results)
    for (std::size_t i = 0; i < result.comparisons.size(); ++i)
      table.add_row({std::to_string(result.setting.uv_nodes),
                     std::to_string(result.setting.st_nodes),
                     std::to_string(result.setting.codewords),
                     number_text(training_share(result.setting)),
                     std::to_string(i),
                     number_text(result.comparisons[i].psnr_db)});
  return table;
}

/// One panel of the figure: the settings that differ from the base in this parameter alone.
template <typename ValueOf>
SweepPanel panel_of(const std::vector<SettingResult>& results,
                    const std::string& label,
                    ValueOf value_of) {
  SweepPanel panel{label, true, {}};
  const PrecomputeOptions& base = results.front().setting;
  for (const SettingResult& result : results) {
    const bool is_base = &result == &results.front();
    if (!is_base && std::invoke(value_of, result.setting) == std::invoke(value_of, base)) continue;
    const SampleSummary psnr = psnr_of(result);
    panel.points.push_back({static_cast<double>(std::invoke(value_of, result.setting)),
                            psnr.lower_quartile,
                            psnr.median,
                            psnr.upper_quartile,
                            is_base});
  }
  std::sort(panel.points.begin(), panel.points.end(), [](const auto& a, const auto& b) {
    return a.x < b.x;
  });
  return panel;
}

json result_json(const SettingResult& result) {
  return {{"uv_nodes", result.setting.uv_nodes},
          {"st_nodes", result.setting.st_nodes},
          {"codewords", result.setting.codewords},
          {"training_fraction", training_share(result.setting)},
          {"field", result.field},
          {"field_file", result.setting.output},
          {"psnr_db", to_json(psnr_of(result))},
          {"uncompressed_bytes", result.uncompressed_bytes},
          {"payload_bytes", result.info.payload_bytes},
          {"file_bytes", result.info.file_bytes},
          {"creation_seconds", result.creation_seconds},
          {"creation_ranks", result.creation_ranks}};
}

std::string to_toml(const FieldParametersOptions& options) {
  std::ostringstream out;
  const auto list = [&](const char* name, const auto& values) {
    out << name << " = [";
    for (std::size_t i = 0; i < values.size(); ++i)
      out << (i == 0 ? "" : ", ") << number_text(static_cast<double>(values[i]));
    out << "]\n";
  };
  out << af::to_toml(options.base);
  list("sweep_uv_nodes", options.uv_nodes);
  list("sweep_st_nodes", options.st_nodes);
  list("sweep_codewords", options.codewords);
  list("sweep_training_fraction", options.training_fractions);
  out << "pose_count = " << options.pose_count
      << "\ndrr_step_mm = " << number_text(options.drr_step_mm) << "\npose_seed = " << options.seed
      << '\n';
  return out.str();
}

void write_results(const FieldParametersOptions& options,
                   const std::vector<SettingResult>& results,
                   const Provenance& provenance) {
  const std::filesystem::path& folder = options.output_folder;
  write_text_file(folder / "field-parameters.csv", settings_table(results).to_text());
  write_text_file(folder / "field-parameters-poses.csv", poses_table(results).to_text());
  draw_sweep_panels({panel_of(results, "(u,v) nodes per side", &PrecomputeOptions::uv_nodes),
                     panel_of(results, "(s,t) nodes per side", &PrecomputeOptions::st_nodes),
                     panel_of(results, "codewords", &PrecomputeOptions::codewords),
                     panel_of(results, "share of tiles for training", training_share)},
                    "DRR quality against the field's parameters",
                    "PSNR (dB)",
                    folder / "field-parameters");
  write_reproduce_script(folder, provenance);
  json summary = {{"format", "attenuation-fields evaluation"},
                  {"format_version", 1},
                  {"kind", "field-parameters"},
                  {"camera", options.base.camera},
                  {"poses", options.pose_count},
                  {"figures", {"field-parameters"}}};
  summary["settings"] = json::array();
  for (const SettingResult& result : results) summary["settings"].push_back(result_json(result));
  summary["provenance"] = af::to_json(provenance);
  // Last: when it is there, everything is.
  write_text_file(folder / "summary.json", summary.dump(2) + "\n");
  for (const SettingResult& result : results)
    std::cout << "uv " << result.setting.uv_nodes << ", st " << result.setting.st_nodes << ", "
              << result.setting.codewords << " codewords, training "
              << number_text(training_share(result.setting)) << ": PSNR median "
              << fixed_text(psnr_of(result).median, 2) << " dB, "
              << fixed_text(static_cast<double>(result.info.payload_bytes) / 1e6, 1) << " MB, "
              << fixed_text(result.creation_seconds, 1) << " s\n";
  std::cout << "results: " << folder.string() << '\n';
}

/// The camera of a study's only view stays to be named; its CT is read for the reference.
std::filesystem::path ct_path_of(const PrecomputeOptions& base) {
  if (!base.ct.empty()) return base.ct;
  return read_study(base.study).find_case(base.case_name).ct;
}

}  // namespace

std::vector<std::string> problems(const FieldParametersOptions& options) {
  std::vector<std::string> found;
  std::set<std::string> distinct;
  for (const PrecomputeOptions& setting : settings_of(options))
    for (const std::string& text : af::problems(setting))
      if (distinct.insert(text).second) found.push_back(text);
  if (options.base.camera.empty()) found.emplace_back("--camera = '': must name a camera");
  if (options.base.ct.empty() == options.base.study.empty())
    found.emplace_back("--ct or --study: exactly one must be given");
  if (options.pose_count < 1)
    found.push_back("--pose-count = " + std::to_string(options.pose_count) + ": must be >= 1");
  for (const std::string& text : af::problems(RayCasterOptions{options.drr_step_mm}))
    found.push_back(text);
  return found;
}

CLI::App* bind_field_parameters(CLI::App& app, FieldParametersOptions& options) {
  CLI::App* command = app.add_subcommand(
      "field-parameters",
      "PSNR of a camera's fields against each of the four field parameters, with memory, creation "
      "time and compression (the paper's Fig. 10 and Table I); builds the fields that are missing");
  PrecomputeOptions& base = options.base;
  base.max_translation_mm = 30.0;
  base.training_fraction = 0.1;  // the paper's
  auto* ct = command->add_option("--ct", base.ct, "CT: image file or DICOM folder");
  command->add_option("--series", base.series_uid, "DICOM series UID, when there are several");
  command->add_option("--rig", base.rig, "rig.toml, or c-arm-12in, treatment-room");
  command->add_option("--study", base.study, "study.toml that names CT, rig and pose instead")
      ->excludes(ct);
  command->add_option("--case", base.case_name, "Case of the study (default: its only one)");
  command->add_option("--camera", base.camera, "Camera of the rig")->required();
  command->add_option("--max-rotation-deg", base.max_rotation_deg, "Range of every field, degrees")
      ->capture_default_str();
  command->add_option("--max-translation-mm", base.max_translation_mm, "Range of every field, mm")
      ->capture_default_str();
  command->add_option("--slabs", base.slabs, "Depth slabs of every field")->capture_default_str();
  command->add_option("--base-uv-nodes", base.uv_nodes, "(u,v) nodes while others vary")
      ->capture_default_str();
  command->add_option("--base-st-nodes", base.st_nodes, "(s,t) nodes while others vary")
      ->capture_default_str();
  command->add_option("--base-codewords", base.codewords, "Codewords while others vary")
      ->capture_default_str();
  command
      ->add_option("--base-training-fraction",
                   *base.training_fraction,
                   "Share of the tiles for training while others vary")
      ->capture_default_str();
  const auto add_sweep = [&](const char* name, auto& values, const char* what) {
    command->add_option(name, values, std::string("Comma-separated: ") + what)
        ->delimiter(',')
        ->capture_default_str();
  };
  add_sweep("--uv-nodes", options.uv_nodes, "(u,v) nodes per side to try");
  add_sweep("--st-nodes", options.st_nodes, "(s,t) nodes per side to try");
  add_sweep("--codewords", options.codewords, "codebook sizes to try");
  add_sweep("--training-fraction", options.training_fractions, "training shares to try");
  command->add_option("--pose-count", options.pose_count, "Random poses, the same for every field")
      ->capture_default_str();
  command->add_option("--step-mm", options.drr_step_mm, "Longest step of the reference DRRs, mm")
      ->capture_default_str();
  command->add_option("--seed", options.seed, "Of the random poses")->capture_default_str();
  command->add_option("--fields",
                      options.fields_folder,
                      "Where fields are kept and looked for (default: OUTPUT/fields)");
  command->add_option("-o,--output", options.output_folder, "Folder for the results")->required();
  return command;
}

void run_field_parameters(const FieldParametersOptions& options,
                          const std::string& command_line,
                          const Communicator& world) {
  const std::filesystem::path fields =
      options.fields_folder.empty() ? options.output_folder / "fields" : options.fields_folder;
  const std::filesystem::path ct_path = all_or_none(world, [&] {
    throw_if_any(problems(options));
    if (world.is_root()) {
      require_gnuplot();
      make_output_folder(options.output_folder);
      make_output_folder(fields);
    }
    return ct_path_of(options.base);
  });
  std::vector<std::string> warnings;
  const NodeCt ct = read_ct_per_node(
      ct_path, {options.base.series_uid}, options.base.attenuation_model(), world, warnings);
  for (const std::string& text : warnings) cli::warn(world, text);
  const RayCastDrr reference(ct.volume, {options.drr_step_mm});
  Provenance provenance = {"af-evaluate field-parameters",
                           command_line,
                           to_toml(options),
                           options.seed,
                           world.size(),
                           {{"ct", ct.facts.content_sha256}}};
  std::vector<SettingResult> results;
  for (PrecomputeOptions setting : settings_of(options)) {
    setting.output = (fields / field_name(setting)).string();
    SettingResult& result = results.emplace_back();
    result.setting = setting;
    const auto field = field_of(setting, command_line, world, result.info);
    all_or_none(world, [&] {
      if (field->identity.ct_content_sha256 != ct.facts.content_sha256)
        throw FileError(setting.output,
                        "CT of the field (ct_content_sha256)",
                        ct.facts.content_sha256,
                        field->identity.ct_content_sha256);
    });
    result.field = field_description(*field);
    result.uncompressed_bytes = uncompressed_bytes_of(setting);
    read_creation(result.info, result);
    result.comparisons = compare(options, field, reference, world);
    provenance.input_sha256["field " + field_name(setting)] = result.info.payload_sha256;
  }
  all_or_none(world, [&] {
    if (world.is_root()) write_results(options, results, provenance);
  });
}

}  // namespace af::evaluation
