// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "cli/run_limits.h"
#include "cli/sub_command.h"
#include "ct/ct_reader.h"
#include "ct/ray_caster.h"
#include "drr/xray_beam.h"

namespace af::evaluation {

/// `af-evaluate image-quality` as typed.
struct ImageQualityOptions {
  std::filesystem::path field;
  std::filesystem::path ct;
  std::filesystem::path study;     ///< instead of both: all its cases and views
  std::vector<std::string> cases;  ///< of the study; empty: all
  int pose_count = 100;
  std::string rig;     ///< of another camera than the field's; empty: the field's
  std::string camera;  ///< of that rig
  std::filesystem::path poses;
  std::string look_up;       ///< empty: the field's own
  int split_loss_poses = 0;  ///< so many poses' losses are split
  RayCasterOptions ray_caster;
  XrayBeamOptions beam;
  CtReadOptions ct_reading;
  std::uint64_t seed = 1;
  cli::ResumeOptions resume;
  std::filesystem::path output_folder;

  void describe(Fields& field_list);
};

std::vector<std::string> problems(const ImageQualityOptions& options);

/// Collective. Compares a field's DRRs with ray casting (Fig. 8), for its own camera, the one of
/// --rig and --camera, or those of the study, and writes image-quality.csv, figures, the pictures
/// of the worst and the median pair, summary.json and reproduce.sh. For a study, every view's field
/// gets its own folder, CASE-CAMERA, and the run's folder gets one table, one box plot and the
/// worst pairs side by side.
cli::SubCommand image_quality_command(CLI::App& app);

}  // namespace af::evaluation
