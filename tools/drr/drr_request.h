// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/thread_pool.h"
#include "ct/ct_reader.h"
#include "ct/ray_caster.h"
#include "drr/drr_renderer.h"
#include "drr/xray_beam.h"
#include "ranks/communicator.h"

namespace af::tools {

/// The options of af-drr as typed.
struct DrrOptions {
  std::filesystem::path field;
  std::vector<std::string> more_fields;  ///< for the same CT, but other angles
  std::filesystem::path ct;
  CtReadOptions ct_reading;
  std::filesystem::path study;  ///< instead of ct and rig
  std::string study_case;       ///< empty: the only one
  std::string rig;
  std::string camera;
  std::optional<std::array<double, 3>> rotation_deg;
  std::optional<std::array<double, 3>> translation_mm;
  std::filesystem::path pose;
  std::filesystem::path poses;
  std::string look_up;  ///< empty: the field's own
  AttenuationModel attenuation;
  RayCasterOptions ray_caster;
  XrayBeamOptions beam;
  bool compare = false;
  int threads = 1;  ///< 0: every processor
  std::filesystem::path output;

  void describe(Fields& field_list);
};

/// All impossible values and combinations of options; empty when the options are sound.
std::vector<std::string> problems(const DrrOptions& options);

/// Collective. Makes the requested DRRs and writes them. Throws InputError when a ray of a pose is
/// outside the field, FileError when --compare's CT is not the field's.
void run_drr(const DrrOptions& options, const Communicator& world);

}  // namespace af::tools
