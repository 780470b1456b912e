// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "parallel/communicator.h"

namespace af::evaluation {

/// `af-evaluate image-quality` as typed.
struct ImageQualityOptions {
  std::filesystem::path field;
  std::filesystem::path ct;
  int pose_count = 100;
  std::filesystem::path poses;
  std::string look_up = "linear";
  double step_mm = 1.0;
  std::string series_uid;
  std::uint64_t seed = 1;
  std::filesystem::path output_folder;
};

std::vector<std::string> problems(const ImageQualityOptions& options);

/// Adds the subcommand; returns it.
CLI::App* bind_image_quality(CLI::App& app, ImageQualityOptions& options);

/// Collective. Compares a field's DRRs with ray casting (Fig. 8) and writes image-quality.csv,
/// figures, the pictures of the worst and the median pair, summary.json and reproduce.sh.
void run_image_quality(const ImageQualityOptions& options,
                       const std::string& command_line,
                       const Communicator& world);

}  // namespace af::evaluation
