// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "base/described_fields.h"

namespace af {

/// What files of cameras leave open. Nothing here may contradict what a file states.
struct CameraFileOptions {
  std::string format;
  std::vector<std::string> names;
  std::vector<int> size_px;
  std::vector<double> pixel_spacing_mm;
  std::optional<std::array<double, 3>> isocenter_point;
  std::optional<double> unit_mm;
  std::vector<double> detector_origin_mm;
  std::optional<double> source_detector_mm;
  std::optional<double> source_isocenter_mm;
  std::vector<double> positioner_deg;
  std::string flip;

  void describe(Fields& field);
};

}  // namespace af
