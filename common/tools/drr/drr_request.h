// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/thread_pool.h"
#include "drr/drr_renderer.h"
#include "drr/xray_beam.h"
#include "image_files/ct_reader.h"
#include "parallel/communicator.h"
#include "volume/ray_caster.h"

namespace af::tools {

/// The options of af-drr as typed.
struct DrrOptions {
  std::filesystem::path field;
  std::vector<std::string> more_fields;  ///< of the same CT, for other angles
  std::filesystem::path ct;
  CtReadOptions ct_reading;
  std::filesystem::path study;  ///< instead of ct and rig
  std::string study_case;       ///< empty: the only one
  std::string rig;
  std::string camera;
  std::optional<std::array<double, 3>> rotation_deg;
  std::optional<std::array<double, 3>> translation_mm;
  std::filesystem::path pose;
  std::filesystem::path poses;
  std::string look_up;  ///< empty: the field's own
  AttenuationModel attenuation;
  RayCasterOptions ray_caster;
  XrayBeamOptions beam;
  bool compare = false;
  bool invert = false;
  std::array<double, 2> window_percent = {0.5, 99.5};  ///< of PNG files
  int threads = 1;                                     ///< 0: every processor
  std::filesystem::path output;

  void describe(Fields& field_list);
};

/// All impossible values and combinations of options; empty when the options are sound.
std::vector<std::string> problems(const DrrOptions& options);

/// What DRRs are made of and for which camera.
struct DrrSource {
  std::filesystem::path ct;  ///< empty: none
  CtReadOptions ct_reading;
  std::optional<CameraGeometry> camera;  ///< none: the field's
  std::optional<PoseFrame> frame;        ///< none: the field's, or of the CT's centre
  Eigen::Vector3d isocenter_point = Eigen::Vector3d::Zero();
};

/// What renders, for which camera, and what pose parameters are relative to.
struct DrrScene {
  DrrSource source;
  std::shared_ptr<const DrrRenderer> renderer;   ///< the field's, else the ray caster
  std::shared_ptr<const DrrRenderer> reference;  ///< the ray caster, for --compare
  View view;
  PoseFrame frame;
  std::shared_ptr<ThreadPool> pool;
  /// How far the camera is from the field's own, with several fields from the first one's; empty
  /// for that one.
  std::string note;
};

/// Collective. Reads field, CT and rig. FileError when --compare's CT is not the field's.
DrrScene load_scene(const DrrOptions& options, const Communicator& communicator);

/// Poses in the order of the options or their file; `notes` get what was left out of it and
/// assumed.
std::vector<RigidTransform> requested_poses(const DrrOptions& options,
                                            const DrrScene& scene,
                                            std::vector<std::string>& notes);

/// InputError when so many DRRs fit neither into memory nor on the disk of the output.
void require_room(std::size_t poses, const View& view, const std::filesystem::path& output);

/// DRRs of all poses, shared by the threads of the pool; InputError, with `note`, when any ray of
/// any pose is outside the field.
std::vector<Image2d> render_poses(const DrrRenderer& renderer,
                                  const View& view,
                                  const std::vector<RigidTransform>& poses,
                                  ThreadPool& pool,
                                  const std::string& note);

/// One DRR, a stack of several, or a PNG, by the name's extension. Returns a line about it.
std::string write_drrs(const std::vector<Image2d>& drrs,
                       const View& view,
                       const DrrOptions& options);

/// Field, ray cast and difference of one pose in one PNG. Returns the PSNR in words.
std::string write_comparison(const DrrScene& scene,
                             const RigidTransform& room_from_ct,
                             const std::filesystem::path& path);

}  // namespace af::tools
