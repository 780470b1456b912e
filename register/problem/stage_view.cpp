// SPDX-License-Identifier: Apache-2.0
#include "register/problem/stage_view.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.h"
#include "xray/gaussian_blur.h"

namespace af::registration {
namespace {

/// Blocks of step x step pixels, the first one's corner at (column, row).
struct BlockGrid {
  int step;
  int column;
  int row;
};

/// Means (or minima) over blocks.
Image2d block_image(const Image2d& image, const BlockGrid& grid, bool take_minimum) {
  const int step = grid.step;
  Image2d blocks((image.width - grid.column) / step, (image.height - grid.row) / step);
  for (int row = 0; row < blocks.height; ++row)
    for (int column = 0; column < blocks.width; ++column) {
      double sum = 0.0;
      float least = std::numeric_limits<float>::infinity();
      for (int r = 0; r < step; ++r)
        for (int c = 0; c < step; ++c) {
          const float value = image.at(grid.column + column * step + c, grid.row + row * step + r);
          sum += static_cast<double>(value);
          least = std::min(least, value);
        }
      blocks.at(column, row) = take_minimum ? least : static_cast<float>(sum / (step * step));
    }
  return blocks;
}

/// First and count of detector pixels along one axis.
struct Extent {
  int first;
  int count;
};

/// The middle of an extent that a whole number of stage pixels fills.
Extent whole_pixels(const Extent& extent, int step, int limit) {
  const int whole = std::max(1, extent.count / step) * step;
  if (whole > limit)
    throw InputError("size_px",
                     std::to_string(limit),
                     "the detector must hold a pixel of this stage, " + std::to_string(whole) +
                         " detector pixels wide (pixel_step)");
  // A region narrower than a stage pixel, at the detector's edge, moves inwards.
  const int spare = extent.count - whole;
  return {std::min(extent.first + std::max(0, spare) / 2, limit - whole), whole};
}

RegionOfInterest scaled_region(const View& view, const StageGrid& grid) {
  const RegionOfInterest roi = view.scaled(grid.roi_scale).roi;
  const Eigen::Vector2i& size_px = view.camera.size_px;
  const Extent columns = whole_pixels({roi.column, roi.width}, grid.pixel_step, size_px.x());
  const Extent rows = whole_pixels({roi.row, roi.height}, grid.pixel_step, size_px.y());
  return {columns.first, rows.first, columns.count, rows.count};
}

}  // namespace

View stage_view(const View& view, const StageGrid& grid) {
  check(grid.pixel_step >= 1, "a stage pixel has at least one detector pixel");
  const View scaled{view.camera, scaled_region(view, grid)};
  return grid.pixel_step == 1 ? scaled : scaled.coarser(grid.pixel_step);
}

SimilarityReference stage_reference(const Image2d& xray,
                                    const Image2d& mask,
                                    const View& view,
                                    const StageGrid& grid) {
  const int step = grid.pixel_step;
  const RegionOfInterest region = scaled_region(view, grid);
  const BlockGrid blocks{step, region.column % step, region.row % step};
  const RegionOfInterest coarse{
      region.column / step, region.row / step, region.width / step, region.height / step};
  // A mean over n pixels blurs by a variance of (n^2 - 1) / 12 along each axis.
  const double missing = grid.blur_sigma_px * grid.blur_sigma_px - (step * step - 1) / 12.0;
  const double sigma = missing > 0.0 ? std::sqrt(missing) / step : 0.0;
  SimilarityReference reference;
  reference.xray =
      crop(gaussian_blur(step == 1 ? xray : block_image(xray, blocks, false), sigma), coarse);
  if (mask.pixels.empty()) return reference;
  Image2d used = mask;
  for (float& value : used.pixels) value = value != 0.0f ? 1.0f : 0.0f;
  used = crop(step == 1 ? used : block_image(used, blocks, true), coarse);
  for (const float value : used.pixels)
    reference.used.push_back(static_cast<std::uint8_t>(value != 0.0f ? 1 : 0));
  return reference;
}

}  // namespace af::registration
