// SPDX-License-Identifier: Apache-2.0
#include "precompute/field_source.h"

#include <algorithm>
#include <optional>

#include "base/error.h"
#include "base/joined.h"
#include "files/shell_words.h"
#include "ranks/terminal.h"
#include "study/node_ct.h"
#include "study/pose_file.h"
#include "study/rig_file.h"
#include "study/shared_inputs.h"
#include "study/target_place.h"

namespace af {

namespace {

/// The facts that are known before the CT is read; the default centre is the CT's.
struct NamedSource {
  std::string ct_path;
  CtReadOptions ct_reading;
  std::optional<StudyCase> study_case;
  CameraRig rig;
  std::string camera;
  std::optional<PoseFrame> frame;
  std::optional<RigidTransform> nominal_room_from_ct;
};

std::string only_camera(const std::vector<std::string>& cameras, const std::string& where) {
  if (cameras.size() == 1) return cameras.front();
  throw UsageError("--camera is needed: a field belongs to one camera, and " + where + " has " +
                   joined(cameras));
}

NamedSource source_of_study(const PrecomputeOptions& options, const Study& study) {
  const StudyCase& study_case = study.find_case(options.case_name);
  NamedSource source;
  source.ct_path = study_case.ct.string();
  source.ct_reading = study_case.ct_reading;
  source.study_case = study_case;
  source.rig = study.rig;
  source.frame = study_case.frame();
  std::vector<std::string> cameras;
  for (const StudyView& view : study_case.views) cameras.push_back(view.camera);
  const std::string where = "case '" + study_case.name + "'";
  source.camera = options.camera.empty() ? only_camera(cameras, where) : options.camera;
  if (std::find(cameras.begin(), cameras.end(), source.camera) == cameras.end())
    throw InputError("--camera",
                     source.camera,
                     "must be one that " + where + " has: " + joined(cameras),
                     options.study);
  return source;
}

/// Collective.
NamedSource source_of_options(const PrecomputeOptions& options,
                              const Communicator& communicator,
                              std::vector<std::string>& warnings) {
  NamedSource source;
  source.ct_path = options.ct;
  source.ct_reading = options.ct_reading;
  source.rig = shared_rig(options.rig, communicator, &warnings);
  source.camera = options.camera;
  if (options.camera.empty()) {
    std::vector<std::string> cameras;
    for (const CameraGeometry& camera : source.rig.cameras) cameras.push_back(camera.name);
    source.camera =
        all_or_none(communicator, [&] { return only_camera(cameras, "rig " + options.rig); });
  }
  if (!options.nominal_pose.empty())
    source.nominal_room_from_ct =
        shared_poses(communicator, [&] {
          return std::vector{read_pose(
              options.nominal_pose, {std::nullopt, "--ct " + shell_quoted(options.ct)}, &warnings)};
        }).front();
  return source;
}

/// Collective.
NamedSource named_source(const PrecomputeOptions& options,
                         const Communicator& communicator,
                         std::vector<std::string>& warnings) {
  if (!options.study.empty()) {
    const Study study = shared_study(options.study, communicator);
    return all_or_none(communicator, [&] { return source_of_study(options, study); });
  }
  all_or_none(communicator, [&] {
    if (options.ct.empty() || options.rig.empty())
      throw UsageError("name a CT and a camera: --ct CT --rig RIG --camera NAME, or --study STUDY");
  });
  return source_of_options(options, communicator, warnings);
}

PoseFrame frame_of(const NamedSource& source,
                   const PrecomputeOptions& options,
                   const CtGrid& ct_grid) {
  if (source.frame.has_value()) return *source.frame;
  const Eigen::Vector3d center =
      options.center_ct_mm.empty()
          ? ct_grid.center_mm()
          : Eigen::Vector3d(
                options.center_ct_mm[0], options.center_ct_mm[1], options.center_ct_mm[2]);
  if (source.nominal_room_from_ct.has_value())
    return PoseFrame::about(*source.nominal_room_from_ct, center);
  return {Eigen::Matrix3d::Identity(), center, source.rig.isocenter_point};
}

/// The smallest box of the six parameters that holds `about_one` about every pose.
MotionRange range_about(const std::vector<RigidTransform>& poses,
                        const PoseFrame& frame,
                        const MotionRange& about_one) {
  PoseParameters low = parameters_from_pose(frame, poses.front());
  PoseParameters high = low;
  for (const RigidTransform& pose : poses) {
    const PoseParameters parameters = parameters_from_pose(frame, pose);
    low = {low.rotation_rad.cwiseMin(parameters.rotation_rad),
           low.translation_mm.cwiseMin(parameters.translation_mm)};
    high = {high.rotation_rad.cwiseMax(parameters.rotation_rad),
            high.translation_mm.cwiseMax(parameters.translation_mm)};
  }
  return {PoseParameters{low.rotation_rad + about_one.low.rotation_rad,
                         low.translation_mm + about_one.low.translation_mm},
          PoseParameters{high.rotation_rad + about_one.high.rotation_rad,
                         high.translation_mm + about_one.high.translation_mm}};
}

}  // namespace

FieldSource load_source(const PrecomputeOptions& options, const Communicator& communicator) {
  FieldSource source;
  std::vector<std::string> warnings;
  const NamedSource named = named_source(options, communicator, warnings);
  source.camera = all_or_none(communicator, [&] { return named.rig.camera(named.camera); });
  const StudyPlaces places = named.study_case ? named.study_case->places : StudyPlaces();
  const NodeCt ct = naming_study_line(places, "ct", [&] {
    return read_ct_per_node(
        named.ct_path, named.ct_reading, options.attenuation, communicator, warnings);
  });
  if (named.study_case)
    all_or_none(communicator, [&] { require_target_in_ct(*named.study_case, ct.facts.grid); });
  source.volume = options.is_of_bone() ? bone_per_node(*ct.volume, communicator) : ct.volume;
  source.ct_path = named.ct_path;
  source.ct_reading = named.ct_reading;
  source.ct = ct.facts.identity;
  source.frame = frame_of(named, options, ct.facts.grid);
  source.isocenter_point = named.rig.isocenter_point;
  source.range = all_or_none(communicator, [&] { return options.range(); });
  if (!options.cover.empty()) {
    const std::vector<RigidTransform> poses = shared_poses(communicator, [&] {
      return read_poses(
          options.cover, {source.frame, "--ct " + shell_quoted(named.ct_path)}, &warnings);
    });
    source.range = range_about(poses, source.frame, source.range);
    all_or_none(communicator, [&] { throw_if_any(problems(source.range)); });
  }
  if (!options.cover_rig.empty())
    source.more_cameras = shared_rig(options.cover_rig, communicator, &warnings).cameras;
  if (!options.projections.empty())
    source.projections = load_measured_views(
        options,
        *source.volume,
        source.frame.nominal_room_from_ct().linear().transpose() * source.camera.beam_direction(),
        communicator,
        warnings);
  for (const std::string& warning : warnings) warn(communicator, warning);
  if (source.projections != nullptr) inform(communicator, source.projections->text());
  return source;
}

}  // namespace af
