// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "parallel/communicator.h"

namespace af::evaluation {

/// `af-evaluate registration` as typed.
struct RegistrationStudyOptions {
  std::filesystem::path study;
  std::vector<std::string> cases;   ///< empty: all
  std::vector<std::string> fields;  ///< CAMERA=PATH each
  std::string renderer = "field";   ///< "field", "raycast" or "both"
  int starts_per_interval = 30;
  int intervals = 8;
  double interval_width_mm = 2.0;
  std::optional<int> raycast_starts_per_interval;  ///< with "both"; default: as many
  std::optional<int> raycast_intervals;            ///< with "both"; default: as many
  std::string gold = "auto";
  std::string preset = "paper";
  std::optional<std::string> similarity;  ///< these replace what the preset says
  std::optional<std::string> optimizer;
  double equivalence_margin_mm = 0.25;
  double water_mu_per_mm = 0.0200;
  double step_mm = 1.0;
  std::string series_uid;
  std::uint64_t seed = 1;
  std::filesystem::path output_folder;

  /// Renderers in the order of rows: "field" before "raycast".
  [[nodiscard]] std::vector<std::string> renderers() const;
};

std::vector<std::string> problems(const RegistrationStudyOptions& options);

std::string to_toml(const RegistrationStudyOptions& options);

/// Adds the subcommand; returns it.
CLI::App* bind_registration(CLI::App& app, RegistrationStudyOptions& options);

/// Collective. Registers a study's cases from stratified starts (Sec. IV-B) and writes starts.csv
/// (before anything is registered), registrations.csv, figures, overlays, summary.json and
/// reproduce.sh.
void run_registration(const RegistrationStudyOptions& options,
                      const std::string& command_line,
                      const Communicator& world);

}  // namespace af::evaluation
