// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <tuple>
#include <vector>

namespace af {

/// Rectangle of detector pixels.
struct RegionOfInterest {
  int column = 0;
  int row = 0;
  int width = 0;
  int height = 0;

  auto members() { return std::tie(column, row, width, height); }
  bool operator==(const RegionOfInterest&) const = default;
  [[nodiscard]] std::size_t pixel_count() const {
    return static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  }
};

/// Why a region does not fit on a detector of columns x rows pixels; empty when it does.
std::vector<std::string> problems(const RegionOfInterest& roi, int columns, int rows);

/// Row-major float image; pixel (column, row) is pixels[row * width + column].
struct Image2d {
  int width = 0;
  int height = 0;
  std::vector<float> pixels;

  Image2d() = default;
  Image2d(int image_width, int image_height)
      : width(image_width),
        height(image_height),
        pixels(static_cast<std::size_t>(image_width) * static_cast<std::size_t>(image_height)) {}

  auto members() { return std::tie(width, height, pixels); }
  [[nodiscard]] float& at(int column, int row) { return pixels[index(column, row)]; }
  [[nodiscard]] float at(int column, int row) const { return pixels[index(column, row)]; }

 private:
  [[nodiscard]] std::size_t index(int column, int row) const {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(width) +
           static_cast<std::size_t>(column);
  }
};

/// The part of an image inside a region that lies within it.
Image2d crop(const Image2d& image, const RegionOfInterest& roi);

}  // namespace af
