// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "cli/sub_command.h"
#include "ct/ray_caster.h"
#include "drr/xray_beam.h"
#include "register/field_paths.h"
#include "register/method/method_options.h"
#include "study/study_file.h"

namespace af::evaluation {

/// Which methods are compared with a case's X-rays, and how. These options belong to every
/// subcommand that registers or measures similarity.
struct MethodOptions {
  std::filesystem::path study;
  registration::FieldPaths fields;
  std::string renderer = "field";  ///< "field", "raycast" or "both"
  std::string gold = "auto";
  registration::MethodOptions method;
  AttenuationModel attenuation;  ///< for ray casting
  RayCasterOptions ray_caster;
  XrayBeamOptions beam;

  /// Renderers in the order of rows: "field" before "raycast".
  [[nodiscard]] std::vector<std::string> chosen_renderers() const;
  void describe(Fields& field);
};

/// Adds problems of the fields' paths.
void append_problems(const MethodOptions& options, std::vector<std::string>& found);

/// Prints the chains of a preset, with the options that replace parts of it, as TOML.
cli::SubCommand method_command(CLI::App& app);

}  // namespace af::evaluation
