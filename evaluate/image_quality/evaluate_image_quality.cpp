// SPDX-License-Identifier: Apache-2.0
#include "evaluate/image_quality/evaluate_image_quality.h"

#include <algorithm>
#include <cmath>
#include <iostream>
#include <memory>
#include <optional>
#include <tuple>

#include "base/error.h"
#include "base/toml_text.h"
#include "drr/field_renderer.h"
#include "drr/opened_field.h"
#include "drr/ray_cast_drr.h"
#include "evaluate/image_quality/image_quality_tables.h"
#include "evaluate/image_quality/loss_split.h"
#include "evaluate/image_quality/loss_split_tables.h"
#include "evaluate/report/evaluation_run.h"
#include "evaluate/report/report_program.h"
#include "evaluate/report/row_gathering.h"
#include "evaluate/report/sample_summary_json.h"
#include "figures/picture.h"
#include "files/options_toml.h"
#include "files/output_file.h"
#include "files/resource_check.h"
#include "files/sha256.h"
#include "files/shell_words.h"
#include "geometry/camera_distance.h"
#include "ranks/root_only.h"
#include "ranks/run_folder.h"
#include "ranks/terminal.h"
#include "study/node_ct.h"
#include "study/pose_file.h"
#include "study/rig_file.h"
#include "study/study_file.h"

namespace af::evaluation {
namespace {

using nlohmann::json;

/// One field to compare.
struct Target {
  std::string case_name;  ///< empty when the field has no study
  std::filesystem::path field;
  std::filesystem::path ct;
  CtReadOptions ct_reading;
  std::filesystem::path folder;          ///< for its results
  std::optional<CameraGeometry> camera;  ///< without it the field's
};

/// The output that all fields of a study share.
struct TargetResult {
  std::string case_name;
  std::string camera;
  std::vector<DrrComparison> comparisons;
  std::vector<PicturePanel> worst_pair;

  [[nodiscard]] std::string label() const {
    return (case_name.empty() ? "camera" : case_name) + " " + camera;
  }
};

/// Everything that a comparison needs, the same on every rank.
struct Setup {
  std::shared_ptr<const OpenedField> field;
  std::shared_ptr<const OpenedField> bone;  ///< none for one energy
  NodeCt ct;
  std::vector<RigidTransform> poses;  ///< empty: random ones
  View view;
  CameraDistance camera_distance;  ///< between the view's camera and the field's
  MotionRange range;  ///< of random poses: the field's, or what it covers for another camera

  [[nodiscard]] std::string look_up(const ImageQualityOptions& options) const {
    return options.look_up.empty() ? field->info().look_up : options.look_up;
  }
  [[nodiscard]] bool has_fitted_viewpoints() const {
    const OptionTexts made_with = option_texts(field->info().provenance.options_toml);
    const auto samples = made_with.find("uv_samples");
    return samples != made_with.end() && samples->second == "\"least-squares\"";
  }
  [[nodiscard]] std::int64_t pose_count(const ImageQualityOptions& options) const {
    return poses.empty() ? options.pose_count : static_cast<std::int64_t>(poses.size());
  }
};

/// Sets the camera to look through and the range of random poses. An atlas holds its range at each
/// of its angles, while a field's range is that of its own camera.
void choose_camera(const Target& target, Setup& setup) {
  const FieldIdentity& identity = setup.field->identity();
  setup.view = View::whole_detector(identity.camera);
  setup.range = identity.range;
  if (!target.camera.has_value() && setup.field->field()) return;
  if (target.camera.has_value()) {
    setup.camera_distance = camera_distance(*target.camera, identity.camera);
    if (setup.camera_distance.is_none() && setup.field->field()) return;
    setup.view = View::whole_detector(*target.camera);
  }
  const FieldCoverage& coverage = setup.field->coverage();
  const std::int64_t outside =
      coverage.rays_outside(identity.frame.nominal_room_from_ct(), setup.view);
  if (outside > 0)
    throw InputError(
        "camera",
        setup.view.camera.name,
        "the field does not hold all of its rays at the field's nominal pose; it has " +
            coverage.distance_text(setup.view.camera),
        target.field.string());
  setup.range = coverage.box(setup.view, identity.frame, identity.range);
  if (setup.field->atlas() &&
      setup.range.max_rotation_rad() >= identity.range.symmetric_part().max_rotation_rad())
    setup.range = identity.range;
}

Setup load(const ImageQualityOptions& options, const Target& target, const Communicator& world) {
  Setup setup;
  setup.field = std::make_shared<const OpenedField>(target.field, world);
  if (options.beam.needs_bone())
    setup.bone = std::make_shared<const OpenedField>(setup.field->bone(world));
  const FieldIdentity& identity = setup.field->identity();
  std::vector<std::string> warnings;
  setup.ct = read_ct_per_node(target.ct,
                              target.ct_reading,
                              {identity.mu_water_per_mm, identity.air_below_hu},
                              world,
                              warnings);
  for (const std::string& text : warnings) warn(world, text);
  std::vector<std::string> notes;
  all_or_none(world, [&] {
    require_same_ct(
        target.field.string(), setup.ct.facts.identity, target.ct.string(), identity.ct);
    const FieldLattice lattice =
        setup.field->field() ? setup.field->field()->lattice() : setup.field->atlas()->lattice();
    if (options.split_loss_poses > 0 && lattice.slabs.size() != 1)
      throw InputError(
          "--split-loss-poses",
          std::to_string(options.split_loss_poses),
          "needs a field of one slab; this has " + std::to_string(lattice.slabs.size()),
          target.field.string());
    if (options.split_loss_poses > 0 && setup.look_up(options) != "linear")
      throw InputError("--split-loss-poses",
                       std::to_string(options.split_loss_poses),
                       "is for linear look-up; the field's own is " + setup.look_up(options) +
                           ": give --look-up linear",
                       target.field.string());
    if (options.split_loss_poses > 0 && setup.has_fitted_viewpoints())
      throw InputError("--split-loss-poses",
                       std::to_string(options.split_loss_poses),
                       "is for point samples; this field has least-squares viewpoints",
                       target.field.string());
    choose_camera(target, setup);
    if (options.poses.empty()) return;
    setup.poses =
        read_poses(options.poses, {identity.frame, "--ct " + shell_quoted(target.ct)}, &notes);
  });
  for (const std::string& text : notes) warn(world, text);
  if (!setup.camera_distance.is_none())
    inform(world,
           "camera " + setup.view.camera.name + ": " + setup.camera_distance.text() +
               "; the field covers its rays within " + setup.range.text() + " of nominal");
  return setup;
}

DrrComparison compare(const ImageQualityOptions& options,
                      const Setup& setup,
                      DrrComparer& comparer,
                      std::int64_t index) {
  const FieldIdentity& identity = setup.field->identity();
  if (setup.poses.empty())
    return comparer.at_random_pose(
        identity.frame, setup.range, options.seed, static_cast<std::uint64_t>(index));
  const RigidTransform& pose = setup.poses[static_cast<std::size_t>(index)];
  return comparer.at_pose(identity.frame, parameters_from_pose(identity.frame, pose));
}

/// Field, ray casting and their difference at one pose.
std::vector<PicturePanel> pair_panels(const DrrComparison& comparison,
                                      const DrrComparer& comparer,
                                      const std::string& what) {
  const Image2d& field = comparer.tested_image();
  const Image2d& cast = comparer.reference_image();
  Image2d difference = field;
  for (std::size_t i = 0; i < difference.pixels.size(); ++i) difference.pixels[i] -= cast.pixels[i];
  const double top = comparison.reference_maximum;
  constexpr double kDifferenceShare = 0.05;
  const std::string before = what.empty() ? "" : what + ": ";
  return {{field, 0.0, top, before + "field", "look-up in the compressed field", {}, {}},
          {cast, 0.0, top, before + "ray casting", "the reference", {}, {}},
          {difference,
           -kDifferenceShare * top,
           kDifferenceShare * top,
           before + "difference, PSNR " + fixed_text(comparison.psnr_db, 1) + " dB",
           "field - ray casting, window +-5 % of the maximum",
           PicturePanel::Colors::Diverging,
           {}}};
}

int zoom_of(const Image2d& image) {
  return std::max(1, 360 / std::max(image.width, image.height));
}

void write_pair(const std::vector<PicturePanel>& panels,
                const std::string& which,
                std::size_t index,
                std::size_t count,
                const std::filesystem::path& folder) {
  write_picture(panels,
                3,
                "Pose " + std::to_string(index) + ", the " + which + " of " + std::to_string(count),
                folder / (which + "-pair.png"),
                zoom_of(panels.front().image));
}

void write_results(const ImageQualityOptions& options,
                   const Target& target,
                   const Setup& setup,
                   DrrComparer& comparer,
                   const std::vector<LossSplit>& splits,
                   TargetResult& result,
                   const Provenance& provenance) {
  const std::filesystem::path& folder = target.folder;
  const std::vector<DrrComparison>& comparisons = result.comparisons;
  // From here on the results of an earlier run in this folder are incomplete.
  remove_output(folder / "summary.json");
  write_text_file(folder / "image-quality.csv",
                  csv_table(image_quality_rows(comparisons)).to_text());
  json field = field_description(
      setup.field->identity(), *setup.field->coverage().planes.front(), setup.field->codewords());
  if (setup.field->atlas()) field["members"] = setup.field->coverage().planes.size();
  json summary = summary_of_kind("image-quality");
  summary["figures"] = {"psnr"};
  summary["pictures"] = json::array();
  for (const auto& [which, share] : {std::pair("worst", 0.0), std::pair("median", 0.5)}) {
    const auto index = comparison_at(comparisons, share);
    if (!index.has_value()) continue;
    const DrrComparison comparison =
        compare(options, setup, comparer, static_cast<std::int64_t>(*index));
    write_pair(pair_panels(comparison, comparer, ""), which, *index, comparisons.size(), folder);
    if (std::string(which) == "worst")
      result.worst_pair = pair_panels(comparison, comparer, result.label());
    summary["pictures"].push_back({{"file", std::string(which) + "-pair.png"},
                                   {"which", which},
                                   {"pose_index", *index},
                                   {"psnr_db", number_json(comparisons[*index].psnr_db)}});
  }
  if (!target.case_name.empty()) summary["case"] = target.case_name;
  if (!splits.empty()) {
    summary["loss_split"] = write_loss_split(splits, folder);
    summary["figures"].push_back("loss-split");
  }
  summary["field"] = field;
  summary["has_fitted_viewpoints"] = setup.has_fitted_viewpoints();
  summary["field"]["file_bytes"] = setup.field->info().file_bytes;
  summary["field"]["payload_bytes"] = setup.field->info().payload_bytes;
  summary["look_up"] = setup.look_up(options);
  summary["camera_distance"] = camera_distance_json(setup.camera_distance, setup.range);
  summary.update(image_quality_statistics(comparisons));
  write_results_last(folder / "summary.json", std::move(summary), provenance);

  const SampleSummary psnr = [&] {
    std::vector<double> values;
    for (const DrrComparison& comparison : comparisons)
      if (!std::isnan(comparison.psnr_db)) values.push_back(comparison.psnr_db);
    return summarize(values);
  }();
  std::cout << result.label() << ": PSNR median " << fixed_text(psnr.median, 2)
            << " dB, 5th percentile " << fixed_text(psnr.percentile_5, 2) << ", minimum "
            << fixed_text(psnr.minimum, 2) << " over " << psnr.count
            << " poses\nresults: " << folder.string() << '\n';
}

/// Collective. The losses at the first poses, on rank 0.
std::vector<LossSplit> split_losses(const ImageQualityOptions& options,
                                    const Setup& setup,
                                    const DrrRenderer& field,
                                    const DrrRenderer& reference,
                                    DrrComparer& comparer,
                                    const UnfinishedWork& unfinished,
                                    const Communicator& world) {
  const std::int64_t count =
      std::min<std::int64_t>(options.split_loss_poses, setup.pose_count(options));
  if (count == 0) return {};
  const LossSplitter splitter(field,
                              reference,
                              {setup.ct.volume,
                               options.ray_caster,
                               *setup.field->coverage().planes.front(),
                               InterpolatedPlanes::Both},
                              setup.view);
  return collected_rows<LossSplit>(
      world, unfinished, count, "losses split", [&](std::int64_t index) {
        const PoseParameters parameters = compare(options, setup, comparer, index).parameters;
        return splitter.at_pose(pose_from_parameters(setup.field->identity().frame, parameters));
      });
}

using RendererPointer = std::shared_ptr<const DrrRenderer>;

/// The renderers that are compared.
struct Renderers {
  RendererPointer field;
  RendererPointer ray_cast;
};

/// Collective.
Renderers renderers_of(const ImageQualityOptions& options,
                       const Setup& setup,
                       const Communicator& world) {
  const auto cast = [&](const std::shared_ptr<const AttenuationVolume>& volume) {
    return std::make_shared<const RayCastDrr>(volume, options.ray_caster);
  };
  const auto beam =
      all_or_none(world, [&] { return XrayBeam(options.beam, setup.ct.volume->model()); });
  const RendererPointer field = setup.field->renderer(options.look_up);
  if (!setup.bone)
    return {beam.renderer(field, nullptr), beam.renderer(cast(setup.ct.volume), nullptr)};
  const auto bone = bone_per_node(*setup.ct.volume, world);
  const RendererPointer bone_field = setup.bone->renderer(setup.look_up(options));
  return {beam.renderer(field, bone_field), beam.renderer(cast(setup.ct.volume), cast(bone))};
}

/// Collective. Compares one field and writes its folder. Rank 0 has the result.
TargetResult evaluate_target(const ImageQualityOptions& options,
                             const Target& target,
                             const std::string& command_line,
                             const RunFolder& run,
                             const Communicator& world) {
  do_on_root(world, [&] { make_folder(target.folder); });
  const Setup setup = load(options, target, world);
  const auto [field, ray_cast] = renderers_of(options, setup, world);
  DrrComparer comparer(*field, *ray_cast, setup.view);
  Provenance provenance = {"af-evaluate image-quality",
                           command_line,
                           to_toml(options),
                           options.seed,
                           world.size(),
                           {{"field " + setup.view.camera.name, setup.field->info().payload_sha256},
                            {"ct", setup.ct.facts.identity}}};
  if (setup.bone)
    provenance.inputs["bone field " + setup.view.camera.name] = setup.bone->info().payload_sha256;
  do_on_root(world, [&] {
    if (!options.poses.empty()) provenance.inputs["poses"] = sha256_of_file(options.poses.string());
    if (!options.rig.empty())
      for (const std::filesystem::path& file : rig_files(options.rig))
        provenance.inputs["rig " + file.filename().string()] = sha256_of_file(file.string());
  });
  const std::string name = target.folder.filename().string();
  const auto unfinished = [&](const std::string& what) {
    DecidingValues values = deciding_values(deciding_options(options), provenance.inputs);
    if (!setup.camera_distance.is_none())
      values["camera"] = camera_distance_json(setup.camera_distance, setup.range).dump();
    return run.unfinished(name + what, values);
  };
  const std::int64_t count = setup.pose_count(options);
  all_or_none(world, [&] {
    require_memory("--pose-count",
                   static_cast<double>(count) * static_cast<double>(sizeof(DrrComparison)));
  });
  TargetResult result{target.case_name, setup.view.camera.name, {}, {}};
  announce_time(world, "poses compared", count, [&] {
    std::ignore = compare(options, setup, comparer, 0);
    return 1.0;
  });
  result.comparisons = collected_rows<DrrComparison>(
      world, unfinished("-poses"), count, "poses compared", [&](std::int64_t index) {
        return compare(options, setup, comparer, index);
      });
  const std::vector<LossSplit> splits =
      split_losses(options, setup, *field, *ray_cast, comparer, unfinished("-losses"), world);
  do_on_root(world,
             [&] { write_results(options, target, setup, comparer, splits, result, provenance); });
  return result;
}

/// The fields to compare: that of --field, or those of the study's views.
std::vector<Target> targets_of(const ImageQualityOptions& options) {
  const bool has_field = !options.field.empty() && !options.ct.empty();
  const bool has_any = !options.field.empty() || !options.ct.empty();
  if (options.study.empty() ? !has_field : has_any)
    throw UsageError("name a field and its CT, --field FIELD --ct CT, or --study STUDY alone");
  if (options.study.empty())
    return {{"",
             options.field,
             options.ct,
             options.ct_reading,
             options.output_folder,
             options.rig.empty() ? std::nullopt
                                 : std::optional(read_rig(options.rig).camera(options.camera))}};
  const Study study = read_study(options.study);
  std::vector<Target> targets;
  for (const StudyCase* study_case : study.chosen_cases(options.cases))
    for (const StudyView& view : study_case->views) {
      if (!view.field.has_value())
        throw InputError("case '" + study_case->name + "', view '" + view.camera + "': field",
                         "none",
                         "must be in the study",
                         study.path.string());
      targets.push_back({study_case->name,
                         *view.field,
                         study_case->ct,
                         study_case->ct_reading,
                         options.output_folder / (study_case->name + "-" + view.camera),
                         study.rig.camera(view.camera)});
    }
  return targets;
}

/// Writes one table, box plot and sheet of pairs for all fields of a study.
void write_together(const std::vector<TargetResult>& results, const std::filesystem::path& folder) {
  std::vector<CsvCells> rows;
  std::vector<PicturePanel> panels;
  for (const TargetResult& result : results) {
    for (CsvCells& row : image_quality_rows(
             result.comparisons, {{"case", result.case_name}, {"camera", result.camera}}))
      rows.push_back(std::move(row));
    panels.insert(panels.end(), result.worst_pair.begin(), result.worst_pair.end());
  }
  write_text_file(folder / "image-quality.csv", csv_table(std::move(rows)).to_text());
  write_picture(panels,
                3,
                "The worst pair of every field",
                folder / "worst-pairs.png",
                zoom_of(panels.front().image));
  std::cout << "all fields: " << (folder / "worst-pairs.png").string() << '\n';
}

}  // namespace

void ImageQualityOptions::describe(Fields& field_list) {
  field_list("field", field, "Field file of one camera").input();
  field_list("ct", ct, "The CT the field was made from: image file or DICOM folder").input();
  field_list("study", study, "Instead of both: study.toml whose views name their fields").input();
  field_list("case", cases, "Case of the study, may be repeated (default: all)");
  field_list("rig",
             rig,
             "With --camera: look through another camera, whose rays the field holds [the field's "
             "own camera]")
      .excludes({"--study"})
      .needs({"--camera"})
      .input();
  field_list("camera", camera, "Camera of the rig").needs({"--rig"}).input();
  field_list("pose_count", pose_count, "Random poses, uniform in the six parameters").at_least(1);
  field_list("poses",
             poses,
             "CSV of poses instead of random ones: rx_deg ... tz_mm relative to the field's frame, "
             "or m00 ... m23 of room_from_ct")
      .excludes({"--pose-count"})
      .input();
  field_list(
      "look_up", look_up, "How DRRs are looked up [the field's own way]. " + field_look_up_help())
      .choice(field_look_up_names());
  field_list("split_loss_poses",
             split_loss_poses,
             "Split the loss at this many poses into interpolation and quantisation; some ten "
             "ray-cast DRRs each")
      .at_least(0);
  field_list.part(ray_caster);
  field_list.part(beam);
  describe_beside_ct(field_list, ct_reading);
  field_list("seed", seed, "Seed of the random poses");
  field_list.part(resume);
  field_list("output", output_folder, "Folder for the results")
      .as("-o,--output")
      .required()
      .not_deciding("results are the same");
}

std::vector<std::string> problems(const ImageQualityOptions& options) {
  std::vector<std::string> found = field_problems(options);
  if (!options.study.empty() && !options.poses.empty())
    found.push_back("--poses = '" + options.poses.string() + "': must not be given with --study");
  if (options.split_loss_poses > 0 && !options.look_up.empty() && options.look_up != "linear")
    found.push_back("--split-loss-poses = " + std::to_string(options.split_loss_poses) +
                    ": must be 0 for a look-up other than linear");
  if (options.split_loss_poses > 0 && !options.beam.is_ordinary())
    found.push_back("--split-loss-poses = " + std::to_string(options.split_loss_poses) +
                    ": must be 0 with --tube-kvp and --scatter-to-primary");
  return found;
}

namespace {

void run_image_quality(const ImageQualityOptions& options,
                       const std::string& command_line,
                       const Communicator& world) {
  all_or_none(world, [&] { throw_if_any(problems(options)); });
  RunFolder run({options.output_folder,
                 {"image-quality.csv", "reproduce.sh", "summary.json"},
                 options.resume.restarts},
                world);
  run.open();
  const std::vector<Target> targets = all_or_none(world, [&] { return targets_of(options); });
  std::vector<TargetResult> results;
  results.reserve(targets.size());
  for (const Target& target : targets)
    results.push_back(evaluate_target(options, target, command_line, run, world));
  do_on_root(world, [&] {
    std::vector<std::string> drawn;
    for (const Target& target : targets) drawn.push_back(target.folder.string());
    if (!options.study.empty()) {
      write_together(results, options.output_folder);
      drawn.push_back(options.output_folder.string());
    }
    run.finish();
    draw_results(drawn, world);
  });
}

}  // namespace

cli::SubCommand image_quality_command(CLI::App& app) {
  cli::SubCommand command = cli::sub_command(app,
                                             "image-quality",
                                             "DRRs of a field against ray casting at random poses "
                                             "of its range: PSNR, box plot, worst pair",
                                             run_image_quality);
  cli::bind_run_limits(*command.app);
  return command;
}

}  // namespace af::evaluation
