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
  std::vector<std::string> cases;  ///< of the study; empty for all
  int pose_count = 100;
  std::string rig;     ///< with another camera than the field's; empty for the field's
  std::string camera;  ///< of that rig
  std::filesystem::path poses;
  std::string look_up;       ///< empty for the field's own
  int split_loss_poses = 0;  ///< how many poses' losses are split
  RayCasterOptions ray_caster;
  XrayBeamOptions beam;
  CtReadOptions ct_reading;
  std::uint64_t seed = 1;
  cli::ResumeOptions resume;
  std::filesystem::path output_folder;

  void describe(Fields& field_list);
};

std::vector<std::string> problems(const ImageQualityOptions& options);

/// Collective. Compares a field's DRRs with ray casting (Fig. 8), for its own camera, for that of
/// --rig and --camera, or for those of the study. Writes image-quality.csv, figures, the pictures
/// of the worst and the median pair, summary.json and reproduce.sh. For a study, every view's field
/// gets its own folder, CASE-CAMERA. The run's folder then gets one table, one box plot, and the
/// worst pairs side by side.
cli::SubCommand image_quality_command(CLI::App& app);

}  // namespace af::evaluation
