// SPDX-License-Identifier: Apache-2.0
#include <CLI/CLI.hpp>

#include "cli/app_main.h"
#include "cli/run_limits.h"
#include "precompute/precompute_field.h"

namespace {

using af::PrecomputeOptions;

void bind_source(CLI::App& app, PrecomputeOptions& options) {
  auto* ct = app.add_option("--ct", options.ct, "CT: image file or DICOM folder");
  app.add_option("--series", options.series_uid, "DICOM series UID, when the folder holds several");
  auto* rig = app.add_option(
      "--rig", options.rig, "Cameras: a rig.toml, or a shipped rig: c-arm-12in, treatment-room");
  app.add_option("--camera",
                 options.camera,
                 "Camera of the rig, in upper or lower case (a field belongs to one camera)");
  auto* center = app.add_option("--center-ct-mm",
                                options.center_ct_mm,
                                "x,y,z: point of the CT (DICOM LPS, mm) about which it turns and "
                                "which the nominal pose puts at the isocentre [CT centre]")
                     ->delimiter(',');
  auto* pose = app.add_option("--nominal-pose",
                              options.nominal_pose,
                              "File with room_from_ct about which the range is taken [identity "
                              "rotation, centre at the rig's isocentre]");
  auto* study = app.add_option(
      "--study", options.study, "study.toml that names CT, rig, pose and centre instead");
  app.add_option("--case", options.case_name, "Case of the study [the only one]")->needs(study);
  for (CLI::Option* other : {ct, rig, center, pose}) study->excludes(other);
}

void bind_field(CLI::App& app, PrecomputeOptions& options) {
  app.add_option("--max-rotation-deg",
                 options.max_rotation_deg,
                 "Range: largest angle about each room axis, degrees")
      ->capture_default_str();
  app.add_option("--max-translation-mm",
                 options.max_translation_mm,
                 "Range: largest shift along each room axis, mm")
      ->capture_default_str();
  app.add_option("--slabs",
                 options.slabs,
                 "Depth slabs K, each with its own (s,t) plane: with 8, some 8 --uv-nodes suffice; "
                 "1 is the paper's field")
      ->capture_default_str();
  app.add_option(
      "--st-plane",
      options.st_plane,
      "Where the (s,t) planes stand: centre (all through the field's centre) or centroid "
      "(each where its slab's attenuation is) [centre for one slab, else centroid]");
  app.add_option("--uv-nodes",
                 options.uv_nodes,
                 "Viewpoints along each side of the (u,v) plane, both edges included")
      ->capture_default_str();
  app.add_option("--st-nodes",
                 options.st_nodes,
                 "Nodes along each side of the uncropped (s,t) plane, both edges included")
      ->capture_default_str();
  app.add_option("--caster",
                 options.caster,
                 "How line integrals are made: shear-warp (the CT resampled once, then slice by "
                 "slice; some 100 times faster) or trilinear (the reference: samples along every "
                 "ray)")
      ->capture_default_str();
  app.add_option("--step-mm",
                 options.step_mm,
                 "Trilinear caster: largest distance of samples along a ray, mm")
      ->capture_default_str();
  app.add_option("--water-mu-per-mm",
                 options.water_mu_per_mm,
                 "Attenuation of water, 1/mm: mu = this * max(0, 1 + HU/1000)")
      ->capture_default_str();
}

void bind_codebook(CLI::App& app, PrecomputeOptions& options) {
  app.add_option("--codewords", options.codewords, "Size of the codebook, 2 to 65536")
      ->capture_default_str();
  app.add_option(
      "--training-fraction",
      options.training_fraction,
      "Share of the tiles that are not empty on which the codebook is trained; the "
      "paper's was 0.1 [64 tiles per codeword, at most a million, at most 8 of 9 tiles]");
  app.add_option("--max-training-tiles",
                 options.max_training_tiles,
                 "Most training tiles, whatever the share")
      ->capture_default_str();
  app.add_option("--max-iterations",
                 options.max_iterations,
                 "Most iterations of the training; it ends when one gains less than 0.5 %")
      ->capture_default_str();
  app.add_option("--seed", options.seed, "Seed of every random choice")->capture_default_str();
}

void bind_run(CLI::App& app, PrecomputeOptions& options) {
  app.add_option("-o,--output", options.output, "The field file to write, FIELD.h5");
  app.add_option(
         "--memory-limit",
         options.memory_limit_bytes,
         "Memory that each rank may take beside the CT and its grid, which every node holds "
         "once, e.g. 8GB. Tiles that do not fit are read back or cast again, see --overflow "
         "[300 MiB]")
      ->transform(CLI::AsSizeValue(true));
  app.add_option("--overflow",
                 options.overflow,
                 "What happens, once the codebook is trained, to tiles that did not fit: read-back "
                 "(from FIELD.h5.progress), cast-again, or auto (what is faster, measured)")
      ->capture_default_str();
  app.add_option("--mpi-io-hint",
                 options.mpi_io_hints,
                 "KEY=VALUE, once per hint to MPI-IO: cb_nodes, cb_buffer_size, striping_factor, "
                 "...; precompute/README.md has which and when [MPI's own choice]")
      ->allow_extra_args(false);
  app.add_flag("--dry-run",
               options.is_dry_run,
               "Print sizes, memory, compression, expected time and advice; write nothing");
  app.add_flag("--restart", options.is_restart, "Throw away unfinished work in FIELD.h5.progress");
  app.add_flag_callback(
      "--no-checkpoint",
      [&options] { options.has_checkpoint = false; },
      "Do not keep unfinished work in FIELD.h5.progress; tiles that do not fit are cast again");
}

}  // namespace

int main(int argc, char** argv) {
  PrecomputeOptions options;
  CLI::App app{
      "Makes an attenuation field: all line integrals through a CT that one camera can see while "
      "the CT moves within a range, vector-quantised, in one HDF5 file. Run it alone or under "
      "mpirun; the result does not depend on the number of ranks. Stopped by SIGUSR1 or killed, it "
      "continues where it was when the same command is run again."};
  bind_source(app, options);
  bind_field(app, options);
  bind_codebook(app, options);
  bind_run(app, options);
  af::cli::bind_run_limits(app);
  const std::string command = af::cli::command_line(argc, argv);
  return af::cli::app_main(app, argc, argv, [&](const af::Communicator& world) {
    af::run_precompute(options, command, world);
  });
}
