// SPDX-License-Identifier: Apache-2.0
#include <iostream>

#include <CLI/CLI.hpp>

#include "base/error.h"
#include "cli/app_main.h"
#include "cli/bind_options.h"
#include "cli/slicer_module.h"
#include "files/output_file.h"
#include "run/terminal.h"
#include "tools/drr/drr_request.h"

namespace {

using af::tools::DrrOptions;

void run(const DrrOptions& options, const af::Communicator& world) {
  af::throw_if_any(problems(options));
  if (world.is_root()) af::announce_output(options.output);
  const af::tools::DrrScene scene = af::tools::load_scene(options, world);
  std::vector<std::string> notes;
  const std::vector<af::RigidTransform> poses = af::tools::requested_poses(options, scene, notes);
  for (const std::string& text : notes) af::warn(world, text);
  if (!world.is_root()) return;
  if (!scene.note.empty()) std::cout << scene.note << '\n';
  if (options.compare) {
    const std::string words = af::tools::write_comparison(scene, poses.front(), options.output);
    std::cout << options.output.string() << ": " << words << '\n';
    return;
  }
  af::tools::require_room(poses.size(), scene.view, options.output);
  const std::vector<af::Image2d> drrs =
      af::tools::render_poses(*scene.renderer, scene.view, poses, *scene.pool, scene.note);
  std::cout << af::tools::write_drrs(drrs, scene.view, options) << '\n';
}

}  // namespace

// Binding options can throw only by a defect, which may well end the program.
// NOLINTNEXTLINE(bugprone-exception-escape)
int main(int argc, char** argv) {
  DrrOptions options;
  CLI::App app{
      "Makes digitally reconstructed radiographs, from an attenuation field or by ray casting."};
  af::cli::bind_options(app, options);
  af::cli::bind_slicer_module(app, "Digitally reconstructed radiograph");
  return af::cli::app_main(
      app, argc, argv, [&](const af::Communicator& world) { run(options, world); });
}
