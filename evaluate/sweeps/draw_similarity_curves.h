// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "evaluate/methods/evaluated_methods.h"
#include "parallel/communicator.h"

namespace af::evaluation {

/// `af-evaluate similarity-curves` as typed.
struct SimilarityCurvesOptions : MethodOptions {
  SimilarityCurvesOptions() {
    renderer = "both";
    method.preset = "paper";  // a curve is of one measure
  }

  std::string case_name;  ///< empty: the study's only one
  double half_width_mm = 5.0;
  double half_width_deg = 5.0;
  double curve_step_mm = 0.1;
  double curve_step_deg = 0.1;
  bool restarts = false;
  std::filesystem::path output_folder;
};

std::vector<std::string> problems(const SimilarityCurvesOptions& options);

/// Adds the subcommand; returns it.
CLI::App* bind_similarity_curves(CLI::App& app, SimilarityCurvesOptions& options);

/// Collective. The similarity along each pose parameter about the gold pose (Fig. 14), by the
/// objective of the preset's last pass; writes similarity-curves.csv, maxima.csv, the figure,
/// summary.json and reproduce.sh.
void run_similarity_curves(const SimilarityCurvesOptions& options,
                           const std::string& command_line,
                           const Communicator& world);

}  // namespace af::evaluation
