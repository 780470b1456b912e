// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "cli/app_forward.h"
#include "register/case_loading.h"
#include "register/method/method_options.h"
#include "register/method/registration.h"

namespace af::registration {

/// The options of af-register as typed.
struct RegisterOptions {
  std::filesystem::path study;
  std::string case_name;
  std::vector<std::string> fields;  ///< CAMERA=PATH each
  std::string renderer = "field";
  MethodOptions method;
  std::optional<std::array<double, 3>> start_rotation_deg;
  std::optional<std::array<double, 3>> start_translation_mm;
  std::filesystem::path start_pose;
  std::filesystem::path starts;
  double water_mu_per_mm = 0.0200;
  double step_mm = 1.0;
  std::string series_uid;
  bool skip_ct_check = false;
  bool restarts = false;
  std::filesystem::path output_folder;
};

/// Adds the options to the program.
void bind_options(CLI::App& app, RegisterOptions& options);

/// All impossible values and combinations of options; empty when the options are sound.
std::vector<std::string> problems(const RegisterOptions& options);

/// `coarsest_level`: of the method.
CaseLoadOptions case_load_options(const RegisterOptions& options, int coarsest_level = 0);

/// The starts of a run: of --starts, or the one of --start-pose, or nominal with
/// --start-rotation-deg and --start-translation-mm.
std::vector<RigidTransform> start_poses(const RegisterOptions& options, const PoseFrame& frame);

/// SHA-256 of the study and, if given, the file of starts, by name.
std::map<std::string, std::string> hashes_of_files(const RegisterOptions& options);

/// The options that are used, as TOML, with presets resolved.
std::string to_toml(const RegisterOptions& options, const RegistrationOptions& registration);

}  // namespace af::registration
