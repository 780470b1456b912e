// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "geometry/camera_geometry.h"
#include "xray/image2d.h"

namespace af {

/// Resamples stored, distorted images to the camera without distortion. It is bilinear between the
/// four stored pixels around a place. Places outside the stored image take its nearest pixel and
/// are masked.
class XrayUndistortion {
 public:
  explicit XrayUndistortion(const CameraGeometry& camera);

  [[nodiscard]] Image2d image(const Image2d& stored) const;
  /// Zero where there is no stored pixel, or where one of the four is masked. `stored` may be
  /// empty.
  [[nodiscard]] Image2d mask(const Image2d& stored) const;
  /// "undistorted (...)": coefficients, interpolation, how many pixels have no data.
  [[nodiscard]] std::string text() const;

 private:
  /// Where an ideal pixel is in the stored image.
  struct Place {
    int column = 0;  ///< column of the first of the four
    int row = 0;
    float across = 0.0f;  ///< towards the next column, 0 to 1
    float down = 0.0f;
    bool is_outside = false;
  };
  [[nodiscard]] Place place_of(const Eigen::Vector2d& stored_px) const;

  LensDistortion lens_;
  int width_;
  int height_;
  std::vector<Place> places_;  ///< one per ideal pixel, row by row
};

}  // namespace af
