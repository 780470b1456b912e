// SPDX-License-Identifier: Apache-2.0
#include "tools/inspect/inspect_run.h"

#include <algorithm>
#include <filesystem>
#include <iostream>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/named_rows.h"
#include "camera_files/camera_formats.h"
#include "files/output_file.h"
#include "pose_files/pose_file.h"
#include "run/terminal.h"
#include "study/pose_context.h"
#include "study/rig_file.h"
#include "study/study_template.h"
#include "tools/inspect/inspection.h"

namespace af {
namespace {

/// Only the named camera, when one is named.
CameraRig cameras_of(CameraRig rig, const std::string& camera) {
  if (!camera.empty()) rig.cameras = {rig.camera(camera)};
  return rig;
}

PoseContext context_of(const PoseConversion& options, const CtReadOptions& ct_reading) {
  if (!options.study.empty()) {
    const Study study = read_study(options.study);
    PoseContext context = pose_context(study, study.find_case(options.study_case), ct_reading);
    if (!options.camera.empty())
      context.rig = [rig = cameras_of(study.rig, options.camera)] { return rig; };
    return context;
  }
  std::optional<CameraRig> rig;
  if (!options.rig.empty()) rig = cameras_of(read_rig(options.rig), options.camera);
  return pose_context(options.ct, ct_reading, rig, std::nullopt);
}

/// The bytes of a file of `options.format` that holds the poses of `path`. What was left out goes
/// to `notes`. InputError and FileError as read_pose_file() and pose_file_bytes().
std::string converted_poses(const std::filesystem::path& path,
                            const PoseConversion& options,
                            const CtReadOptions& ct_reading,
                            std::vector<std::string>& notes) {
  const PoseContext context = context_of(options, ct_reading);
  const PosesInFile found = read_pose_file(path, context);
  notes.insert(notes.end(), found.notes.begin(), found.notes.end());
  std::vector<RigidTransform> poses;
  for (const PosesInFile::Numbered& pose : found.poses) poses.push_back(pose.room_from_ct);
  if (poses.empty()) throw InputError(path.string() + ": holds no pose");
  return pose_file_bytes(options.format, poses, context);
}

/// The report of each path as soon as it is known; JSON is one array.
void print(const InspectOptions& options, const std::vector<Inspection>& inspections) {
  if (!options.as_json) {
    for (const Inspection& inspection : inspections) std::cout << to_text(inspection);
    return;
  }
  auto array = nlohmann::ordered_json::array();
  for (const Inspection& inspection : inspections) array.push_back(to_json(inspection));
  // File headers may hold text of any encoding.
  std::cout << array.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) << '\n';
}

/// The poses of a file in another format.
void convert_poses(const InspectOptions& options, const Communicator& world) {
  if (options.paths.size() != 1 || options.output.empty())
    throw UsageError("--pose-to takes one PATH, and -o names the file to write");
  std::vector<std::string> notes;
  const std::string bytes =
      converted_poses(options.paths.front(), options.poses, options.ct, notes);
  for (const std::string& note : notes) warn(world, note);
  write_text_file(options.output, bytes);
}

/// Cameras of other programs as a rig, or the other way round.
void convert_cameras(const InspectOptions& options, const Communicator& world) {
  std::vector<std::string> warnings;
  const std::vector<std::string> shipped = builtin_rig_names();
  const bool is_shipped = options.rig_from.size() == 1 &&
                          std::ranges::find(shipped, options.rig_from[0].string()) != shipped.end();
  const CameraRig rig = is_shipped
                            ? parse_rig(builtin_rig_text(options.rig_from[0]), options.rig_from[0])
                            : read_camera_files(options.rig_from, options.cameras, &warnings);
  for (const std::string& warning : warnings) warn(world, warning);
  const auto files = camera_files_of(rig, options.rig_to, options.output);
  if (!options.output.empty())
    for (const auto& file : files) announce_output(file.path);
  for (const auto& file : files)
    if (options.output.empty())
      std::cout << file.bytes;
    else
      write_text_file(file.path, file.bytes);
}

}  // namespace

void PoseConversion::describe(Fields& field) {
  field("pose_to",
        format,
        "Write the poses of the one PATH to -o in this format; room_from_ct stays the same. " +
            help_of(pose_formats()))
      .choice(written_pose_formats());
  field("study", study, "With --pose-to: study.toml whose CT, cameras and nominal pose it is of")
      .needs({"--pose-to"});
  field("study_case", study_case, "With --study: its case [the only one]")
      .as("--case")
      .needs({"--study"});
  field("ct", ct, "With --pose-to: the CT, for Autoscoper, DiffDRR and DICOM")
      .needs({"--pose-to"})
      .excludes({"--study"});
  field("rig", rig, "With --pose-to: the cameras, for DiffDRR")
      .needs({"--pose-to"})
      .excludes({"--study"});
  field("camera", camera, "With --pose-to: the camera of the rig or study, for DiffDRR")
      .needs({"--pose-to"});
}

void InspectOptions::describe(Fields& field) {
  field("paths", paths, "Files, folders or names of shipped rigs").as("PATH").one_of_group("What");
  field("template",
        template_name,
        "Print a file to fill in, every key with a comment: study (af-inspect --template study > "
        "study.toml), rig, or scan: a cone-beam scan for af-scan")
      .choice(template_names())
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
        "With --rig-from: format to write the cameras in. " + help_of(camera_formats()))
      .choice(writable_camera_formats())
      .needs({"--rig-from"});
  field.part(cameras);
  field("pictures",
        pictures,
        "Of studies: folder for pictures of each view (X-ray, DRRs at the nominal pose and at that "
        "of the landmarks, with the patient's directions), of the room and of the CT; of a CT: for "
        "pictures of it with its coordinates in mm (LPS), to read off points")
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

void run_inspect(const InspectOptions& options, const Communicator& world) {
  throw_if_any(field_problems(options.cameras));
  if (!options.output.empty() && options.rig_from.empty() && options.poses.format.empty())
    throw UsageError("-o names what --rig-from or --pose-to writes: give one of them");
  if (!options.poses.format.empty()) {
    if (world.is_root()) convert_poses(options, world);
    return;
  }
  if (!options.rig_from.empty()) {
    if (world.is_root()) convert_cameras(options, world);
    return;
  }
  if (!options.template_name.empty()) {
    if (world.is_root()) std::cout << template_text(options.template_name);
    return;
  }
  if (options.lists_views || options.lists_inputs) {
    for (const std::string& path : options.paths) {
      const std::string lines = all_or_none(
          world, [&] { return options.lists_views ? view_lines(path) : input_lines(path); });
      if (world.is_root()) std::cout << lines;
    }
    return;
  }
  if (!options.pictures.empty()) {
    for (const std::string& path : options.paths) {
      all_or_none(world, [&] {
        if (!world.is_root()) return;
        const DrawnPictures drawn = draw_pictures(path, options.ct, options.pictures);
        std::cout << drawn.text << std::flush;
        throw_if_any(drawn.problems);
      });
    }
    return;
  }
  std::vector<Inspection> inspections;
  ExitCode worst = ExitCode::Done;
  std::size_t bad = 0;
  for (const std::string& path : options.paths) {
    inspections.push_back(inspect_path(path, options.ct, world));
    const ExitCode code = worst_exit_code(inspections.back());
    worst = std::max(worst, code);
    bad += code == ExitCode::Done ? 0 : 1;
  }
  if (world.is_root()) print(options, inspections);
  if (worst == ExitCode::Done) return;
  std::cout.flush();
  // Every rank knows the same; only one says it.
  throw RemoteError(worst,
                    std::to_string(bad) + " of " + std::to_string(options.paths.size()) +
                        " paths not usable; the reasons are in the report");
}

}  // namespace af
