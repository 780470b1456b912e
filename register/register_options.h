// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "cli/run_limits.h"
#include "pose_files/pose_format.h"
#include "register/case_loading.h"
#include "register/field_paths.h"
#include "register/method/method_options.h"
#include "register/method/registration.h"
#include "register/uncertainty/uncertainty_estimator.h"

namespace af::registration {

/// The options of af-register as typed.
struct RegisterOptions {
  std::filesystem::path study;
  std::string case_name;
  FieldPaths fields;
  std::string renderer = "field";
  MethodOptions method;
  CorrectionOptions correction;
  UncertaintyOptions uncertainty;
  std::optional<std::array<double, 3>> start_rotation_deg;
  std::optional<std::array<double, 3>> start_translation_mm;
  std::string start = "auto";  ///< or "nominal" or "landmarks", when no other start is given
  std::filesystem::path start_pose;
  std::filesystem::path starts;
  AttenuationModel attenuation;  ///< of ray casting
  RayCasterOptions ray_caster;
  XrayBeamOptions beam;
  CtReadOptions ct;
  bool skip_ct_check = false;
  cli::ResumeOptions resume;
  std::filesystem::path output_folder;

  void describe(Fields& field);
  /// With the preset resolved.
  [[nodiscard]] RegisterOptions in_force() const;
};

/// All impossible values and combinations of options; empty when the options are sound.
std::vector<std::string> problems(const RegisterOptions& options);

/// `coarsest_level` and `last_levels`: of the method.
CaseLoadOptions case_load_options(const RegisterOptions& options,
                                  int coarsest_level = 0,
                                  const std::vector<int>& last_levels = {});

/// Whether the case's landmarks give the start: when they are asked for, or when the case has
/// landmarks and no start is given.
bool starts_from_landmarks(const RegisterOptions& options, const StudyCase& study_case);

/// The starts of a run: of --starts, or the one of --start-pose, or nominal with
/// --start-rotation-deg and --start-translation-mm. `context` is the case's, with its frame;
/// `notes` get what was left out of a file and assumed. InputError when a frame before the last
/// pose of
/// --starts has none: rows are numbered by frames.
std::vector<RigidTransform> start_poses(const RegisterOptions& options,
                                        const PoseContext& context,
                                        std::vector<std::string>& notes);

/// SHA-256 of the study and, if given, the file of starts, by name.
std::map<std::string, std::string> hashes_of_files(const RegisterOptions& options);

}  // namespace af::registration
