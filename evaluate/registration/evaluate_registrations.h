// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "cli/run_limits.h"
#include "cli/sub_command.h"
#include "evaluate/registration/evaluated_methods.h"
#include "evaluate/starts/perturbed_starts.h"
#include "evaluate/statistics/success_rate.h"
#include "register/results/picture_options.h"
#include "register/search/pose_search.h"
#include "register/verdict/uncertainty_estimator.h"

namespace af::evaluation {

/// `af-evaluate registration` as typed. method.seed is also the seed of the starts.
struct RegistrationStudyOptions : MethodOptions {
  registration::CorrectionOptions correction;  ///< corrects the field's ends
  registration::UncertaintyOptions uncertainty;
  std::vector<std::string> cases;  ///< empty for all
  int starts_per_interval = 30;
  int intervals = 8;
  double interval_width_mm = 2.0;
  std::optional<int> raycast_starts_per_interval;  ///< with "both"; default: as many
  std::optional<int> raycast_intervals;            ///< with "both"; default: as many
  std::string start_rule = "stratified";           ///< or "uniform", "within-range", "search"
  registration::PoseSearchOptions search;          ///< of start rule "search"
  std::filesystem::path starts_from;               ///< starts.csv instead of drawn ones
  bool is_starts_only = false;                     ///< write starts.csv and register nothing
  registration::PictureOptions pictures;
  std::optional<std::int64_t> only_start;  ///< in the table of starts, for every renderer
  std::filesystem::path poses_from;        ///< poses that another program found
  std::string method_name = "poses";       ///< what these are called
  double equivalence_margin_mm = 0.1;
  double success_tre_mm = kSuccessTreMm;
  cli::ResumeOptions resume;
  std::filesystem::path output_folder;
  std::string program = "af-evaluate";  ///< as typed, quoted for a shell
  std::string shared_by_repeats;        ///< options as typed, except those of starts and output

  /// Methods in the order of rows: "field" before "raycast". With poses_from, only method_name.
  [[nodiscard]] std::vector<std::string> renderers() const;
  [[nodiscard]] StartOptions start_options() const {
    return {intervals, interval_width_mm, starts_per_interval, method.seed};
  }
  void describe(Fields& field);
  /// These options with the preset resolved. Options for ray casting beside fields, or for another
  /// program's poses, are set only where they apply.
  [[nodiscard]] RegistrationStudyOptions in_force() const;
};

std::vector<std::string> problems(const RegistrationStudyOptions& options);

/// Collective. Registers a study's cases from starts about gold (Sec. IV-B), or takes the poses
/// that another program found. Writes starts.csv (before anything is registered),
/// registrations.csv, figures, overlays, summary.json and reproduce.sh. Finished registrations are
/// kept in OUTPUT.progress/ until all is written. Throws StoppedError when SIGUSR1 asked for a
/// stop.
cli::SubCommand registration_command(CLI::App& app, const std::string& program);

}  // namespace af::evaluation
