// SPDX-License-Identifier: Apache-2.0
#include <iostream>

#include <CLI/CLI.hpp>

#include "base/error.h"
#include "cli/app_main.h"
#include "drr/field_renderer.h"
#include "files/output_file.h"
#include "tools/drr/drr_request.h"

namespace {

using af::tools::DrrOptions;

void bind_source(CLI::App& app, DrrOptions& options) {
  app.add_option("--field",
                 options.field,
                 "Look DRRs up in this field; its own camera is used unless "
                 "--rig and --camera name another");
  app.add_option(
      "--ct", options.ct, "Cast rays through this CT (DICOM folder, NIfTI, MetaImage, NRRD)");
  app.add_option(
      "--series", options.series_uid, "DICOM series UID, when the CT's folder has several");
  app.add_option("--rig", options.rig, "Rig file, or c-arm-12in, or treatment-room");
  app.add_option("--camera", options.camera, "Camera of the rig");
  app.add_option(
         "--interpolation",
         options.interpolation,
         "Look-up in the field: 'nearest' node; 'linear' in u, v, s and t in two quick passes (as "
         "af-register does); 'cubic' in s and t, 'cubic-uv' in all four; or 'quadrilinear', "
         "literally over each ray's 16 neighbours")
      ->check(CLI::IsMember(af::field_look_up_names()))
      ->capture_default_str();
  app.add_option("--water-mu-per-mm",
                 options.water_mu_per_mm,
                 "Attenuation of water, 1/mm, for ray casting (with --compare the field's own)")
      ->capture_default_str();
  app.add_option("--step-mm", options.step_mm, "Longest step of ray casting, mm")
      ->capture_default_str();
}

void bind_pose(CLI::App& app, DrrOptions& options) {
  app.add_option("--rotation-deg",
                 options.rotation_deg,
                 "rx,ry,rz about the room's axes, degrees, relative to the nominal pose: the "
                 "field's, or the CT's centre at the rig's isocentre (default 0,0,0)")
      ->delimiter(',');
  app.add_option("--translation-mm",
                 options.translation_mm,
                 "tx,ty,tz along the room's axes, mm (default 0,0,0)")
      ->delimiter(',');
  app.add_option(
      "--pose", options.pose, "File with room_from_ct (TOML, result.json, ITK .tfm or 16 numbers)");
  app.add_option("--poses",
                 options.poses,
                 "CSV of poses (rx_deg ... tz_mm, or m00 ... m23): one 3-D stack comes out");
}

void bind_output(CLI::App& app, DrrOptions& options) {
  app.add_flag("--compare",
               options.compare,
               "Field, ray cast, difference and PSNR in one PNG (needs --field and --ct)");
  app.add_flag("--invert", options.invert, "PNG: dark is attenuated, the look of a film");
  app.add_option("--window-percent",
                 options.window_percent,
                 "PNG: low,high percentile of the DRR that become black and white")
      ->delimiter(',')
      ->capture_default_str();
  app.add_option("--threads",
                 options.threads,
                 "Threads that share a large DRR, or the DRRs of --poses; 0: every processor")
      ->capture_default_str();
  app.add_option("-o,--output",
                 options.output,
                 "OUT.mha, .nii.gz, .nrrd, .tif: total attenuation, float32, not scaled; OUT.png: "
                 "8 bits, row 0 on top, bright is attenuated")
      ->required();
}

void run(const DrrOptions& options, const af::Communicator& world) {
  af::throw_if_any(problems(options));
  if (world.is_root()) af::announce_output(options.output);
  const af::tools::DrrScene scene = af::tools::load_scene(options, world);
  const std::vector<af::RigidTransform> poses = af::tools::requested_poses(options, scene.frame);
  if (!world.is_root()) return;
  if (options.compare) {
    const std::string words = af::tools::write_comparison(scene, poses.front(), options.output);
    std::cout << options.output.string() << ": " << words << '\n';
    return;
  }
  af::tools::require_room(poses.size(), scene.view, options.output);
  const std::vector<af::Image2d> drrs =
      af::tools::render_poses(*scene.renderer, scene.view, poses, *scene.pool);
  std::cout << af::tools::write_drrs(drrs, scene.view, options) << '\n';
}

}  // namespace

// Binding options can throw only by a defect, which may well end the program.
// NOLINTNEXTLINE(bugprone-exception-escape)
int main(int argc, char** argv) {
  DrrOptions options;
  CLI::App app{
      "Makes digitally reconstructed radiographs, from an attenuation field or by ray casting."};
  bind_source(app, options);
  bind_pose(app, options);
  bind_output(app, options);
  return af::cli::app_main(
      app, argc, argv, [&](const af::Communicator& world) { run(options, world); });
}
