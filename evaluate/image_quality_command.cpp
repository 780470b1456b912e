// SPDX-License-Identifier: Apache-2.0
#include "evaluate/image_quality_command.h"

#include <cmath>
#include <iostream>
#include <memory>
#include <sstream>

#include "base/error.h"
#include "cli/app_main.h"
#include "cli/progress_printer.h"
#include "drr/field_renderer.h"
#include "drr/ray_cast_drr.h"
#include "evaluate/figure_files.h"
#include "evaluate/image_quality_files.h"
#include "evaluate/row_gathering_program.h"
#include "evaluate/summary_files.h"
#include "io/field_file.h"
#include "io/gnuplot_figure.h"
#include "io/node_ct.h"
#include "io/output_file.h"
#include "io/picture.h"
#include "io/pose_file.h"
#include "io/provenance.h"
#include "parallel/work_queue.h"

namespace af::evaluation {
namespace {

using nlohmann::json;

std::string to_toml(const ImageQualityOptions& options) {
  std::ostringstream out;
  out << "field = " << std::quoted(options.field.string())
      << "\nct = " << std::quoted(options.ct.string());
  if (options.poses.empty())
    out << "\npose_count = " << options.pose_count;
  else
    out << "\nposes = " << std::quoted(options.poses.string());
  out << "\nlook_up = \"" << options.look_up << "\"\nstep_mm = " << number_text(options.step_mm)
      << "\nseed = " << options.seed << '\n';
  return out.str();
}

/// Everything a comparison needs, the same on every rank.
struct Setup {
  std::shared_ptr<const CompressedAttenuationField> field;
  FieldFileInfo field_info;
  NodeCt ct;
  std::vector<RigidTransform> poses;  ///< empty: random ones
  View view;

  [[nodiscard]] std::int64_t pose_count(const ImageQualityOptions& options) const {
    return poses.empty() ? options.pose_count : static_cast<std::int64_t>(poses.size());
  }
};

Setup load(const ImageQualityOptions& options, const Communicator& world) {
  Setup setup;
  setup.field = read_field(options.field, world, &setup.field_info);
  const FieldIdentity& identity = setup.field->identity;
  std::vector<std::string> warnings;
  setup.ct = read_ct_per_node(options.ct,
                              {options.series_uid},
                              {identity.mu_water_per_mm, identity.air_below_hu},
                              world,
                              warnings);
  for (const std::string& text : warnings) cli::warn(world, text);
  all_or_none(world, [&] {
    if (setup.ct.facts.content_sha256 != identity.ct_content_sha256)
      throw FileError(options.field.string(),
                      "CT of the field (ct_content_sha256)",
                      setup.ct.facts.content_sha256 + " (" + options.ct.string() + ")",
                      identity.ct_content_sha256);
    if (options.poses.empty()) return;
    setup.poses = read_poses_csv(options.poses, identity.frame);
    if (setup.poses.empty())
      throw InputError("poses", "no row", "must hold at least one pose", options.poses.string());
  });
  setup.view = View::whole_detector(identity.camera);
  return setup;
}

DrrComparison compare(const ImageQualityOptions& options,
                      const Setup& setup,
                      DrrComparer& comparer,
                      std::int64_t index) {
  const FieldIdentity& identity = setup.field->identity;
  if (setup.poses.empty())
    return comparer.at_random_pose(
        identity.frame, identity.range, options.seed, static_cast<std::uint64_t>(index));
  const RigidTransform& pose = setup.poses[static_cast<std::size_t>(index)];
  return comparer.at_pose(identity.frame, parameters_from_pose(identity.frame, pose));
}

void write_pair(const ImageQualityOptions& options,
                const Setup& setup,
                DrrComparer& comparer,
                std::size_t index,
                const std::string& which) {
  const DrrComparison comparison =
      compare(options, setup, comparer, static_cast<std::int64_t>(index));
  const Image2d& field = comparer.tested_image();
  const Image2d& cast = comparer.reference_image();
  Image2d difference = field;
  for (std::size_t i = 0; i < difference.pixels.size(); ++i) difference.pixels[i] -= cast.pixels[i];
  const double top = comparison.reference_maximum;
  constexpr double kDifferenceShare = 0.05;
  const std::vector<PicturePanel> panels = {
      {field, 0.0, top, "Field", "look-up in the compressed field", {}, {}},
      {cast, 0.0, top, "Ray casting", "the reference", {}, {}},
      {difference,
       -kDifferenceShare * top,
       kDifferenceShare * top,
       "Difference",
       "field - ray casting, window +-5 % of the maximum",
       PicturePanel::Colors::Diverging,
       {}}};
  const std::string heading = "Pose " + std::to_string(index) + ", the " + which + " of " +
                              std::to_string(setup.pose_count(options)) + ": PSNR " +
                              fixed_text(comparison.psnr_db, 1) + " dB";
  const int zoom = std::max(1, 360 / std::max(field.width, field.height));
  write_picture(panels, 3, heading, options.output_folder / (which + "-pair.png"), zoom);
}

void write_results(const ImageQualityOptions& options,
                   const Setup& setup,
                   DrrComparer& comparer,
                   const std::vector<DrrComparison>& comparisons,
                   const Provenance& provenance) {
  const std::filesystem::path& folder = options.output_folder;
  write_text_file(folder / "image-quality.csv", image_quality_table(comparisons).to_text());
  PsnrGroup group{"camera " + setup.field->identity.camera.name, {}};
  for (const DrrComparison& comparison : comparisons) group.psnr_db.push_back(comparison.psnr_db);
  draw_psnr_boxes({group}, folder / "psnr");
  json summary = {{"format", "attenuation-fields evaluation"},
                  {"format_version", 1},
                  {"kind", "image-quality"}};
  summary["figures"] = {"psnr"};
  summary["pictures"] = json::array();
  for (const auto& [which, share] : {std::pair("worst", 0.0), std::pair("median", 0.5)}) {
    const auto index = comparison_at(comparisons, share);
    if (!index.has_value()) continue;
    write_pair(options, setup, comparer, *index, which);
    summary["pictures"].push_back({{"file", std::string(which) + "-pair.png"},
                                   {"which", which},
                                   {"pose_index", *index},
                                   {"psnr_db", number_json(comparisons[*index].psnr_db)}});
  }
  summary["field"] = field_description(*setup.field);
  summary["field"]["file_bytes"] = setup.field_info.file_bytes;
  summary["field"]["payload_bytes"] = setup.field_info.payload_bytes;
  summary["look_up"] = options.look_up;
  summary.update(image_quality_statistics(comparisons));
  summary["provenance"] = af::to_json(provenance);
  write_reproduce_script(folder, provenance);
  // Last: when it is there, everything is.
  write_text_file(folder / "summary.json", summary.dump(2) + "\n");

  const SampleSummary psnr = [&] {
    std::vector<double> values;
    for (const double value : group.psnr_db)
      if (!std::isnan(value)) values.push_back(value);
    return summarize(values);
  }();
  std::cout << group.label << ": PSNR median " << fixed_text(psnr.median, 2)
            << " dB, 5th percentile " << fixed_text(psnr.percentile_5, 2) << ", minimum "
            << fixed_text(psnr.minimum, 2) << " over " << psnr.count
            << " poses\nresults: " << folder.string() << '\n';
}

}  // namespace

std::vector<std::string> problems(const ImageQualityOptions& options) {
  std::vector<std::string> found;
  if (options.pose_count < 1)
    found.push_back("--pose-count = " + std::to_string(options.pose_count) + ": must be >= 1");
  for (const std::string& text : af::problems(RayCasterOptions{options.step_mm}))
    found.push_back(text);
  return found;
}

CLI::App* bind_image_quality(CLI::App& app, ImageQualityOptions& options) {
  CLI::App* command = app.add_subcommand(
      "image-quality",
      "DRRs of a field against ray casting at random poses of its motion range (the paper's Fig. "
      "8): PSNR, statistics, box plot, worst pair");
  command->add_option("--field", options.field, "Field file of one camera")->required();
  command
      ->add_option("--ct", options.ct, "The CT the field was made from: image file or DICOM folder")
      ->required();
  auto* count =
      command
          ->add_option(
              "--pose-count", options.pose_count, "Random poses, uniform in the six parameters")
          ->capture_default_str();
  command
      ->add_option("--poses",
                   options.poses,
                   "CSV of poses instead of random ones: rx_deg ... tz_mm relative to the field's "
                   "frame, or m00 ... m23 of room_from_ct")
      ->excludes(count);
  command
      ->add_option("--look-up",
                   options.look_up,
                   "linear in two passes (what registration uses), cubic in (s,t), cubic-uv in "
                   "(u,v) too, quadrilinear (the paper's, literal) or nearest")
      ->check(CLI::IsMember(field_look_up_names()))
      ->capture_default_str();
  command->add_option("--step-mm", options.step_mm, "Longest step of ray casting, mm")
      ->capture_default_str();
  command->add_option(
      "--series", options.series_uid, "DICOM series UID, when the folder has several");
  command->add_option("--seed", options.seed, "Of the random poses")->capture_default_str();
  command->add_option("-o,--output", options.output_folder, "Folder for the results")->required();
  return command;
}

void run_image_quality(const ImageQualityOptions& options,
                       const std::string& command_line,
                       const Communicator& world) {
  all_or_none(world, [&] {
    throw_if_any(problems(options));
    if (!world.is_root()) return;
    require_gnuplot();
    make_output_folder(options.output_folder);
  });
  const Setup setup = load(options, world);
  const auto field = make_field_renderer(setup.field, options.look_up);
  const RayCastDrr ray_cast(setup.ct.volume, {options.step_mm});
  DrrComparer comparer(*field, ray_cast, setup.view);

  const std::int64_t count = setup.pose_count(options);
  std::vector<json> mine;
  {
    cli::ProgressPrinter printer("poses compared", world.is_root());
    for_each_item(
        world,
        count,
        [&](std::int64_t index) {
          mine.push_back(comparison_row(index, compare(options, setup, comparer, index)));
        },
        [&](std::int64_t done) {
          printer.update(static_cast<double>(done), static_cast<double>(count));
        });
  }
  std::vector<DrrComparison> comparisons;
  for (const json& row : gather_rows(world, mine)) comparisons.push_back(comparison_of(row));
  const Provenance provenance = {
      "af-evaluate image-quality",
      command_line,
      to_toml(options),
      options.seed,
      world.size(),
      {{"field " + setup.view.camera.name, setup.field_info.payload_sha256},
       {"ct", setup.ct.facts.content_sha256}}};
  all_or_none(world, [&] {
    if (world.is_root()) write_results(options, setup, comparer, comparisons, provenance);
  });
}

}  // namespace af::evaluation
