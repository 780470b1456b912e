// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "cli/run_limits.h"
#include "cli/sub_command.h"
#include "precompute/build/precompute_options.h"

namespace af::evaluation {

/// `af-evaluate field-parameters` as typed.
struct FieldParametersOptions {
  PrecomputeOptions base;  ///< the setting that all sweeps share: CT, range; camera (empty for all)
  std::vector<int> uv_nodes = {16, 32, 64};
  std::vector<int> st_nodes = {128, 256, 512};
  std::vector<int> codewords = {1024, 4096, 16384, 65536};
  std::vector<double> training_fractions = {0.01, 0.1, 0.3};
  int pose_count = 20;
  RayCasterOptions reference;  ///< for the reference DRRs
  std::uint64_t seed = 1;
  std::filesystem::path fields_folder;  ///< empty for OUTPUT/fields
  cli::ResumeOptions resume;
  std::filesystem::path output_folder;

  void describe(Fields& field);
  /// These options with the rule that places the (s,t) planes.
  [[nodiscard]] FieldParametersOptions in_force() const;
};

std::vector<std::string> problems(const FieldParametersOptions& options);

/// Collective. Measures image quality of fields against each of the four field parameters, the
/// others as in the base setting (Fig. 10), with memory, creation time and compression (Table I),
/// and difference images at three qualities (Fig. 9). It does so for one camera, or for all views
/// of a study together. Fields are built once and kept in a folder. One that exists with the same
/// options is reused. Writes what write_sweep() and write_difference_images() write, summary.json
/// and reproduce.sh.
cli::SubCommand field_parameters_command(CLI::App& app);

}  // namespace af::evaluation
