// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "cli/run_limits.h"
#include "cli/sub_command.h"
#include "evaluate/registration/evaluated_methods.h"

namespace af::evaluation {

/// `af-evaluate similarity-curves` as typed.
struct SimilarityCurvesOptions : MethodOptions {
  std::string case_name;  ///< empty for the study's only one
  double half_width_mm = 5.0;
  double half_width_deg = 5.0;
  double curve_step_mm = 0.1;
  double curve_step_deg = 0.1;
  cli::ResumeOptions resume;
  std::filesystem::path output_folder;

  void describe(Fields& field);
  /// These options with the preset resolved.
  [[nodiscard]] SimilarityCurvesOptions in_force() const;
};

std::vector<std::string> problems(const SimilarityCurvesOptions& options);

/// Collective. Computes the similarity along each pose parameter about the gold pose (Fig. 14), by
/// the objective of the preset's last pass. Writes similarity-curves.csv, maxima.csv, the figure,
/// summary.json and reproduce.sh.
cli::SubCommand similarity_curves_command(CLI::App& app);

}  // namespace af::evaluation
