// SPDX-License-Identifier: Apache-2.0
#include "tools/inspect/pose_conversion.h"

#include "base/error.h"
#include "base/named_rows.h"
#include "pose_files/pose_file.h"
#include "study/pose_context.h"
#include "study/rig_file.h"

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

}  // namespace af
