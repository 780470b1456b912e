// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "ct/attenuation_volume.h"
#include "ct/ct_reader.h"
#include "evaluate/simulate/phantom.h"
#include "evaluate/simulate/stress.h"
#include "evaluate/simulate/xray_simulator.h"

namespace af::tools {

/// A cone-beam scan instead of a study.
struct ConeBeamOptions {
  int views = 0;  ///< 0: a study
  std::vector<double> elevations_deg;
  int elevated_views = 4;

  [[nodiscard]] double step_deg() const { return 360.0 / views; }
  void describe(Fields& field);
};

/// What af-simulate is asked for. Empty strings and vectors mean: not given.
struct SimulateOptions {
  std::string ct;
  CtReadOptions ct_reading;
  std::string phantom;
  PhantomOptions phantom_options;
  std::string rig = "treatment-room";
  std::string case_name;
  std::string output;
  std::uint64_t seed = 1;
  bool copies_ct = false;
  std::string xray_format = "mha";
  bool replaces_output = false;

  std::vector<double> center_ct_mm;      ///< x, y, z
  std::vector<double> target_box_ct_mm;  ///< low x, y, z, high x, y, z
  std::string target_bone;               ///< a bone of the phantom
  std::vector<int> roi_px;               ///< width, height

  double max_offset_rotation_deg = 5.0;
  double max_offset_translation_mm = 10.0;
  std::string moved_bone;  ///< a bone of the phantom
  bool omits_fiducials = false;

  AttenuationModel attenuation;
  XraySimulationOptions xray;
  bool is_ideal = false;
  StressOptions stress;
  ConeBeamOptions cone_beam;

  /// The imaging chain in use: `xray`, or all its effects off when is_ideal, with the requested
  /// stress.
  [[nodiscard]] XraySimulationOptions xray_in_force() const;
  /// Whether X-rays show a phantom's bodies instead of voxels.
  [[nodiscard]] bool images_bodies() const {
    return phantom_options.anatomy_seed.has_value() || !moved_bone.empty();
  }
  /// case_name, or one made from the CT's file name or the phantom.
  [[nodiscard]] std::string case_name_in_force() const;
  void describe(Fields& field);
};

std::vector<std::string> problems(const SimulateOptions& options);

/// The requested phantom. Its target is the moved bone or the target bone, if there is one.
Phantom phantom_of(const SimulateOptions& options);

}  // namespace af::tools
