// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "base/described_fields.h"

namespace af {

/// How a CT's file becomes HU. A CT read in another way has other voxels, and so another content
/// hash: fields and unfinished work of one reading are refused with another.
struct CtReadOptions {
  std::string series_uid;  ///< chooses one of several DICOM series in a folder; empty: there must
                           ///< be only one
  /// Tilted gantries and uneven slices are resampled to an upright grid instead of refused.
  bool resamples = false;
  /// What a voxel's number is: "hu"; "mu", attenuation per mm; "raw", mu = slope * number + offset;
  /// "labels", the number of a tissue.
  std::string values = "hu";
  double raw_slope_per_mm = 0.0;           ///< for "raw"; 0: not given
  double raw_offset_per_mm = 0.0;          ///< for "raw"
  double values_water_mu_per_mm = 0.0200;  ///< mu that becomes 0 HU, for "mu" and "raw"
  std::vector<std::string> label_hu;       ///< for "labels": "3=700"; others are air
  bool keeps_body_only = false;            ///< table and head holder become air

  auto members() {
    return std::tie(series_uid,
                    resamples,
                    values,
                    raw_slope_per_mm,
                    raw_offset_per_mm,
                    values_water_mu_per_mm,
                    label_hu,
                    keeps_body_only);
  }

  void describe(Fields& field);

  /// Short text of what differs from the default, except the series: "values mu (water 0.02 per
  /// mm), body only". Empty when nothing does.
  [[nodiscard]] std::string text() const;
};

std::vector<std::string> problems(const CtReadOptions& options);

/// Number and HU of a label such as "3=700"; nothing for anything else.
std::optional<std::pair<double, double>> label_of(const std::string& text);

/// The options of a program that takes --ct or --study. A study itself says how its CTs are read.
void describe_beside_ct(Fields& field, CtReadOptions& options);

}  // namespace af
