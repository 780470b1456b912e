// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <filesystem>
#include <iostream>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "base/named_rows.h"
#include "camera_files/camera_formats.h"
#include "cli/app_main.h"
#include "cli/bind_options.h"
#include "files/output_file.h"
#include "run/terminal.h"
#include "study/rig_file.h"
#include "study/study_template.h"
#include "tools/inspect/inspection.h"
#include "tools/inspect/pose_conversion.h"

namespace {

using af::Communicator;

struct Options {
  std::vector<std::string> paths;
  std::string template_name;
  bool as_json = false;
  bool lists_views = false;
  bool lists_inputs = false;
  std::vector<std::filesystem::path> rig_from;
  std::string rig_to = "rig";
  af::CameraFileOptions cameras;
  af::PoseConversion poses;
  std::filesystem::path pictures;
  std::filesystem::path output;
  af::CtReadOptions ct;

  void describe(af::Fields& field);
};

void Options::describe(af::Fields& field) {
  field("paths", paths, "Files, folders or names of shipped rigs").as("PATH").one_of_group("What");
  field("template",
        template_name,
        "Print a file to fill in, every key with a comment: study (af-inspect --template study > "
        "study.toml) or rig")
      .choice(af::template_names())
      .one_of_group("What");
  field("json", as_json, "Print one JSON array instead of text");
  field("list_views",
        lists_views,
        "Of studies, for scripts: one line per view, its case and its camera with a tab between "
        "them")
      .excludes({"--json"});
  field("list_inputs",
        lists_inputs,
        "Of studies, for scripts: one line per case and file that it reads, with a tab between "
        "them")
      .excludes({"--json", "--list-views"});
  field("rig_from",
        rig_from,
        "Camera files to make one rig of, each of any of the formats; -o names the rig.toml")
      .one_of_group("What");
  field("rig_to",
        rig_to,
        "With --rig-from: format to write the cameras in. " + af::help_of(af::camera_formats()))
      .choice(af::writable_camera_formats())
      .needs({"--rig-from"});
  field.part(cameras);
  field("pictures",
        pictures,
        "Of studies: folder for pictures of each view (X-ray, DRRs at the nominal pose and at that "
        "of the landmarks, with the patient's directions) and of the room")
      .excludes({"--json", "--list-views", "--list-inputs", "--rig-from", "--pose-to"});
  field.part(poses);
  field("output",
        output,
        "With --rig-from: file to write instead of printing it; with --pose-to: the file to write")
      .as("-o,--output");
  field.part(ct);
  field.at("series").help =
      "SeriesInstanceUID to read from a DICOM folder that holds several series";
}

/// The report of each path as soon as it is known; JSON is one array.
void print(const Options& options, const std::vector<af::Inspection>& inspections) {
  if (!options.as_json) {
    for (const af::Inspection& inspection : inspections) std::cout << af::to_text(inspection);
    return;
  }
  auto array = nlohmann::ordered_json::array();
  for (const af::Inspection& inspection : inspections) array.push_back(af::to_json(inspection));
  // File headers may hold text of any encoding.
  std::cout << array.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) << '\n';
}

/// The poses of a file in another format.
void convert_poses(const Options& options, const Communicator& world) {
  if (options.paths.size() != 1 || options.output.empty())
    throw af::UsageError("--pose-to takes one PATH, and -o names the file to write");
  std::vector<std::string> notes;
  const std::string bytes =
      af::converted_poses(options.paths.front(), options.poses, options.ct, notes);
  for (const std::string& note : notes) af::warn(world, note);
  af::write_text_file(options.output, bytes);
}

/// Cameras of other programs as a rig, or the other way round.
void convert_cameras(const Options& options, const Communicator& world) {
  std::vector<std::string> warnings;
  const std::vector<std::string> shipped = af::builtin_rig_names();
  const bool is_shipped = options.rig_from.size() == 1 &&
                          std::ranges::find(shipped, options.rig_from[0].string()) != shipped.end();
  const af::CameraRig rig =
      is_shipped ? af::parse_rig(af::builtin_rig_text(options.rig_from[0]), options.rig_from[0])
                 : af::read_camera_files(options.rig_from, options.cameras, &warnings);
  for (const std::string& warning : warnings) af::warn(world, warning);
  for (const auto& file : af::camera_files_of(rig, options.rig_to, options.output))
    if (options.output.empty())
      std::cout << file.bytes;
    else
      af::write_text_file(file.path, file.bytes);
}

void run(const Options& options, const Communicator& world) {
  af::throw_if_any(af::field_problems(options.cameras));
  if (!options.output.empty() && options.rig_from.empty() && options.poses.format.empty())
    throw af::UsageError("-o names what --rig-from or --pose-to writes: give one of them");
  if (!options.poses.format.empty()) {
    if (world.is_root()) convert_poses(options, world);
    return;
  }
  if (!options.rig_from.empty()) {
    if (world.is_root()) convert_cameras(options, world);
    return;
  }
  if (!options.template_name.empty()) {
    if (world.is_root()) std::cout << af::template_text(options.template_name);
    return;
  }
  if (options.lists_views || options.lists_inputs) {
    for (const std::string& path : options.paths) {
      const std::string lines = af::all_or_none(world, [&] {
        return options.lists_views ? af::view_lines(path) : af::input_lines(path);
      });
      if (world.is_root()) std::cout << lines;
    }
    return;
  }
  if (!options.pictures.empty()) {
    for (const std::string& path : options.paths) {
      const std::string text = af::all_or_none(world, [&] {
        return world.is_root() ? af::draw_pictures(path, options.ct, options.pictures)
                               : std::string();
      });
      if (world.is_root()) std::cout << text;
    }
    return;
  }
  std::vector<af::Inspection> inspections;
  af::ExitCode worst = af::ExitCode::Done;
  std::size_t bad = 0;
  for (const std::string& path : options.paths) {
    inspections.push_back(af::inspect_path(path, options.ct, world));
    const af::ExitCode code = af::worst_exit_code(inspections.back());
    worst = std::max(worst, code);
    bad += code == af::ExitCode::Done ? 0 : 1;
  }
  if (world.is_root()) print(options, inspections);
  if (worst == af::ExitCode::Done) return;
  std::cout.flush();
  // Every rank knows the same; only one says it.
  throw af::RemoteError(worst,
                        std::to_string(bad) + " of " + std::to_string(options.paths.size()) +
                            " paths not usable; the reasons are in the report");
}

}  // namespace

// Binding options can throw only by a defect, which may well end the program.
// NOLINTNEXTLINE(bugprone-exception-escape)
int main(int argc, char** argv) {
  Options options;
  CLI::App app{
      "Says what files are, whether they are sane, and what they were made from: CTs (image file "
      "or DICOM folder), X-rays and DRRs, rigs, studies, poses, fields (every checksum verified), "
      "results and folders of results. The exit code is the worst over all paths: 0 usable, 3 "
      "readable but unacceptable, 4 not readable or damaged."};
  af::cli::bind_options(app, options);
  return af::cli::app_main(
      app, argc, argv, [&](const Communicator& world) { run(options, world); });
}
