// SPDX-License-Identifier: Apache-2.0
#include "study/xray_undistortion.h"

#include <algorithm>
#include <cmath>

#include "base/number_text.h"

namespace af {

XrayUndistortion::XrayUndistortion(const CameraGeometry& camera)
    : lens_(camera.distortion), width_(camera.size_px.x()), height_(camera.size_px.y()) {
  const PixelDistortion distortion(camera);
  places_.reserve(static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_));
  for (int row = 0; row < height_; ++row)
    for (int column = 0; column < width_; ++column)
      places_.push_back(place_of(
          distortion.stored_from_ideal({static_cast<double>(column), static_cast<double>(row)})));
}

XrayUndistortion::Place XrayUndistortion::place_of(const Eigen::Vector2d& stored_px) const {
  // Rounding must not move a place on the image's last row or column outside.
  constexpr double kRoundingPx = 1e-9;
  const Eigen::Vector2d last(width_ - 1.0, height_ - 1.0);
  const Eigen::Vector2d inside = stored_px.cwiseMax(0.0).cwiseMin(last);
  Place place;
  place.is_outside = !((inside - stored_px).cwiseAbs().maxCoeff() <= kRoundingPx);
  place.column = std::clamp(static_cast<int>(inside.x()), 0, std::max(width_ - 2, 0));
  place.row = std::clamp(static_cast<int>(inside.y()), 0, std::max(height_ - 2, 0));
  place.across = static_cast<float>(inside.x() - place.column);
  place.down = static_cast<float>(inside.y() - place.row);
  return place;
}

Image2d XrayUndistortion::image(const Image2d& stored) const {
  Image2d ideal(width_, height_);
  std::ranges::transform(places_, ideal.pixels.begin(), [&](const Place& place) {
    const int right = std::min(place.column + 1, width_ - 1);
    const int below = std::min(place.row + 1, height_ - 1);
    const float upper =
        std::lerp(stored.at(place.column, place.row), stored.at(right, place.row), place.across);
    const float lower =
        std::lerp(stored.at(place.column, below), stored.at(right, below), place.across);
    return std::lerp(upper, lower, place.down);
  });
  return ideal;
}

Image2d XrayUndistortion::mask(const Image2d& stored) const {
  Image2d ideal(width_, height_);
  std::ranges::transform(places_, ideal.pixels.begin(), [&](const Place& place) {
    if (place.is_outside) return 0.0f;
    if (stored.pixels.empty()) return 1.0f;
    // A neighbour without weight does not count.
    const int right = std::min(place.column + (place.across > 0.0f ? 1 : 0), width_ - 1);
    const int below = std::min(place.row + (place.down > 0.0f ? 1 : 0), height_ - 1);
    const bool is_used = stored.at(place.column, place.row) != 0.0f &&
                         stored.at(right, place.row) != 0.0f &&
                         stored.at(place.column, below) != 0.0f && stored.at(right, below) != 0.0f;
    return is_used ? 1.0f : 0.0f;
  });
  return ideal;
}

std::string XrayUndistortion::text() const {
  std::string text = "undistorted (";
  for (std::size_t i = 0; i < lens_.count(); ++i)
    text += (i > 0 ? " " : "") + number_text(lens_.coefficients[i]);
  const auto outside = std::ranges::count_if(places_, &Place::is_outside);
  return text + ", bilinear; " + std::to_string(outside) + " pixels without data masked)";
}

}  // namespace af
