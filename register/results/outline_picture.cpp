// SPDX-License-Identifier: Apache-2.0
#include "register/results/outline_picture.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "drr/drr_renderer.h"
#include "figures/picture.h"
#include "xray/gaussian_blur.h"
#include "xray/quantile.h"

namespace af::registration {

namespace {

/// Whether the outlines of an image pass through a pixel: its slope is the steepest across them,
/// and among the steepest tenth of the image.
Image2d outlines_of(const Image2d& image) {
  constexpr double kSmoothingPx = 1.0;
  constexpr double kShareOfFlatter = 0.85;
  const Image2d smooth = gaussian_blur(image, kSmoothingPx);
  Image2d slope(image.width, image.height);
  Image2d outlines(image.width, image.height);
  const auto across = [&](int column, int row) {
    return smooth.at(column + 1, row) - smooth.at(column - 1, row);
  };
  const auto down = [&](int column, int row) {
    return smooth.at(column, row + 1) - smooth.at(column, row - 1);
  };
  for (int row = 1; row + 1 < image.height; ++row)
    for (int column = 1; column + 1 < image.width; ++column)
      slope.at(column, row) = std::hypot(across(column, row), down(column, row));
  const float least = nearest_rank(slope.pixels, kShareOfFlatter);
  for (int row = 1; row + 1 < image.height; ++row)
    for (int column = 1; column + 1 < image.width; ++column) {
      const bool is_upright = std::abs(across(column, row)) > std::abs(down(column, row));
      const int right = is_upright ? 1 : 0;
      const float own = slope.at(column, row);
      if (own > least && own >= slope.at(column - right, row - 1 + right) &&
          own > slope.at(column + right, row + 1 - right))
        outlines.at(column, row) = 1.0f;
    }
  return outlines;
}

/// The X-ray. It has no value where the outlines pass, which pictures show in orange.
PicturePanel panel_of(const RegistrationView& view,
                      const RigidTransform& room_from_ct,
                      const std::string& title) {
  std::int64_t rays_outside = 0;
  const Image2d drr = render_image(*view.renderer, room_from_ct, view.view, &rays_outside);
  Image2d xray = crop(view.xray, view.view.roi);
  const auto [low, high] = percentile_window(xray);
  const Image2d outlines = outlines_of(drr);
  for (std::size_t i = 0; i < xray.pixels.size(); ++i)
    if (outlines.pixels[i] > 0.0f) xray.pixels[i] = std::numeric_limits<float>::quiet_NaN();
  PicturePanel panel{xray, low, high, title, "X-ray, and outlines of the DRR", {}, {}};
  panel.has_scale = false;
  if (rays_outside > 0)
    panel.caption += ", of which " + std::to_string(rays_outside) + " rays are outside the field";
  return panel;
}

}  // namespace

void write_outlines(const RegistrationView& view,
                    const RigidTransform& start_room_from_ct,
                    const RigidTransform& room_from_ct,
                    const std::string& heading,
                    const std::filesystem::path& path) {
  const RegionOfInterest& roi = view.view.roi;
  write_picture(
      {panel_of(view, start_room_from_ct, "Before"), panel_of(view, room_from_ct, "After")},
      2,
      heading,
      path,
      std::max(1, 420 / std::max(1, std::max(roi.width, roi.height))));
}

}  // namespace af::registration
