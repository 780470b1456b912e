// SPDX-License-Identifier: Apache-2.0
#include "register/problem/fiducial_mask.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace af::registration {
namespace {

/// The range [first, one past the last) of `size` pixels whose centres may lie within radius_px.
std::pair<int, int> pixels_about(double center_px, double radius_px, int size) {
  const double last = static_cast<double>(size);
  return {static_cast<int>(std::clamp(std::ceil(center_px - radius_px), 0.0, last)),
          static_cast<int>(std::clamp(std::floor(center_px + radius_px) + 1.0, 0.0, last))};
}

void clear_disc(Image2d& mask, const Eigen::Vector2d& center_px, double radius_px) {
  const auto [first_row, end_row] = pixels_about(center_px.y(), radius_px, mask.height);
  const auto [first_column, end_column] = pixels_about(center_px.x(), radius_px, mask.width);
  for (int row = first_row; row < end_row; ++row)
    for (int column = first_column; column < end_column; ++column)
      if ((Eigen::Vector2d(column, row) - center_px).norm() <= radius_px)
        mask.at(column, row) = 0.0f;
}

}  // namespace

Image2d mask_fiducials(Image2d mask,
                       const CameraGeometry& camera,
                       const std::vector<Eigen::Vector2d>& fiducials_px,
                       double radius_px) {
  if (fiducials_px.empty() || radius_px == 0.0) return mask;
  if (mask.pixels.empty()) {
    mask = Image2d(camera.size_px.x(), camera.size_px.y());
    std::fill(mask.pixels.begin(), mask.pixels.end(), 1.0f);
  }
  for (const Eigen::Vector2d& center_px : fiducials_px)
    if (center_px.allFinite()) clear_disc(mask, center_px, radius_px);
  return mask;
}

}  // namespace af::registration
