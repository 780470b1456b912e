// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "base/described_fields.h"
#include "evaluate/scan/self_calibration.h"

namespace af::tools {

/// What af-scan is asked for.
struct ScanOptions {
  std::filesystem::path scan;
  std::filesystem::path folder;  ///< with the images; empty: that of the scan's file
  std::filesystem::path output;
  bool replaces_output = false;
  SelfCalibrationOptions calibration;
  int most_px = 512;
  bool enlarges_small = false;  ///< see room_for_registration()
  FdkOptions fdk;
  int pairs = 5;
  double max_offset_rotation_deg = 3.0;
  double max_offset_translation_mm = 5.0;
  double mask_deviations = 6.0;
  bool is_as_stated = false;        ///< the stated geometry is the true one
  bool writes_projections = false;  ///< writes all views, for fields that they correct
  std::uint64_t seed = 1;
  int threads = 0;

  void describe(Fields& field);
};

std::vector<std::string> problems(const ScanOptions& options);

}  // namespace af::tools
