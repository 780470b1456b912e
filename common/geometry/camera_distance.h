// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "geometry/camera_geometry.h"

namespace af {

/// How far a camera is from the nominal one, for which a field was made (room frame).
struct CameraDistance {
  double source_mm = 0.0;           ///< between the sources
  double rotation_deg = 0.0;        ///< between the detectors' axes, about any axis
  double source_detector_mm = 0.0;  ///< source-detector distance: this camera's minus the nominal
  double detector_mm = 0.0;         ///< largest distance between corresponding corners
  bool has_other_pixels = false;    ///< another size or spacing

  /// Whether all rays are the same: no point differs by more than 1e-3 mm.
  [[nodiscard]] bool is_none() const;
  /// "the nominal camera", or "source 5.00 mm, rotation 1.00 deg, ... from the nominal camera".
  [[nodiscard]] std::string text() const;
};

CameraDistance camera_distance(const CameraGeometry& camera, const CameraGeometry& nominal);

}  // namespace af
