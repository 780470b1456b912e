// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "cli/run_limits.h"
#include "register/case_loading.h"
#include "register/field_paths.h"
#include "register/method/method_options.h"
#include "register/results/picture_options.h"
#include "register/search/pose_search.h"
#include "register/verdict/uncertainty_estimator.h"

namespace af::registration {

/// The options of af-register as typed.
struct RegisterOptions {
  std::filesystem::path study;
  std::string case_name;
  FieldPaths fields;
  std::string renderer = "auto";  ///< or "field" or "raycast"
  MethodOptions method;
  CorrectionOptions correction;
  UncertaintyOptions uncertainty;
  std::optional<std::array<double, 3>> start_rotation_deg;
  std::optional<std::array<double, 3>> start_translation_mm;
  /// Or "nominal", "landmarks" or "search", when no other start is given.
  std::string start = "auto";
  PoseSearchOptions search;  ///< of start "search"
  std::filesystem::path start_pose;
  std::filesystem::path starts;
  AttenuationModel attenuation;  ///< for ray casting
  RayCasterOptions ray_caster;
  XrayBeamOptions beam;
  bool skip_ct_check = false;
  cli::ResumeOptions resume;
  PictureOptions pictures;
  bool is_found_required = false;  ///< a doubtful pose also counts as not found
  std::filesystem::path output_folder;

  void describe(Fields& field);
  /// These options with the preset resolved.
  [[nodiscard]] RegisterOptions in_force() const;
};

/// All impossible values and combinations of options. Empty when the options are sound.
std::vector<std::string> problems(const RegisterOptions& options);

/// The renderer of a case: "field" or "raycast" if that is asked for. Otherwise rays are cast where
/// no view has a field and nothing is asked for that needs one.
std::string renderer_of(const RegisterOptions& options, const StudyCase& study_case);

/// `coarsest_level` and `last_levels`: those of the method.
CaseLoadOptions case_load_options(const RegisterOptions& options,
                                  int coarsest_level = 0,
                                  const std::vector<int>& last_levels = {});

}  // namespace af::registration
