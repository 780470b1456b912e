// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "cli/app_forward.h"
#include "parallel/communicator.h"
#include "register/method/method_options.h"
#include "study/study_file.h"

namespace af::evaluation {

/// Which methods are compared with a case's X-rays, and how: options of every subcommand that
/// registers or measures similarity.
struct MethodOptions {
  std::filesystem::path study;
  std::vector<std::string> fields;  ///< CAMERA=PATH each
  std::string renderer = "field";   ///< "field", "raycast" or "both"
  std::string gold = "auto";
  registration::MethodOptions method;
  double water_mu_per_mm = 0.0200;
  double step_mm = 1.0;
  std::string series_uid;

  /// Renderers in the order of rows: "field" before "raycast".
  [[nodiscard]] std::vector<std::string> chosen_renderers() const;
};

void append_problems(const MethodOptions& options, std::vector<std::string>& found);

/// The options that are used, as lines of TOML.
std::string to_toml(const MethodOptions& options);

/// ["a", "b"] as in TOML.
std::string toml_list(const std::vector<std::string>& values);

void bind_method(CLI::App& command, MethodOptions& options);

/// Adds the subcommand `method`; returns it.
CLI::App* bind_show_method(CLI::App& app, registration::MethodOptions& options);

/// Prints the chains of a preset, with the options that replace parts of it, as TOML.
void show_method(const registration::MethodOptions& options, const Communicator& world);

}  // namespace af::evaluation
