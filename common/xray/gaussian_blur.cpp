// SPDX-License-Identifier: Apache-2.0
#include "xray/gaussian_blur.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace af {

namespace {

std::vector<double> gaussian_kernel(double sigma_px) {
  const int radius = blur_radius_px(sigma_px);
  std::vector<double> kernel;
  double sum = 0.0;
  for (int i = -radius; i <= radius; ++i) {
    kernel.push_back(std::exp(-0.5 * i * i / (sigma_px * sigma_px)));
    sum += kernel.back();
  }
  for (double& weight : kernel) weight /= sum;
  return kernel;
}

}  // namespace

int blur_radius_px(double sigma_px) {
  return sigma_px > 0.0 ? std::max(1, static_cast<int>(std::ceil(4.0 * sigma_px))) : 0;
}

Image2d gaussian_blur(const Image2d& image, double sigma_px) {
  if (!(sigma_px > 0.0)) return image;
  const std::vector<double> kernel = gaussian_kernel(sigma_px);
  const int radius = static_cast<int>(kernel.size() / 2);
  const auto width = static_cast<std::size_t>(image.width);
  const auto row_of = [&](auto& rows, int row) {
    const auto known = static_cast<std::size_t>(std::clamp(row, 0, image.height - 1));
    return rows.pixels.begin() + static_cast<std::ptrdiff_t>(known * width);
  };
  Image2d along_rows(image.width, image.height);
  Image2d blurred(image.width, image.height);
  std::vector<float> wide(width + kernel.size() - 1);
  std::vector<double> sums(width);
  const auto rounded = [](double sum) { return static_cast<float>(sum); };
  for (int row = 0; row < image.height; ++row) {
    const auto own = row_of(image, row);
    for (std::size_t i = 0; i < wide.size(); ++i)
      wide[i] = own[std::clamp(static_cast<int>(i) - radius, 0, image.width - 1)];
    std::fill(sums.begin(), sums.end(), 0.0);
    for (std::size_t k = 0; k < kernel.size(); ++k)
      for (std::size_t column = 0; column < width; ++column)
        sums[column] += kernel[k] * static_cast<double>(wide[column + k]);
    std::transform(sums.begin(), sums.end(), row_of(along_rows, row), rounded);
  }
  for (int row = 0; row < image.height; ++row) {
    std::fill(sums.begin(), sums.end(), 0.0);
    for (std::size_t k = 0; k < kernel.size(); ++k) {
      const float* const other = &*row_of(along_rows, row + static_cast<int>(k) - radius);
      for (std::size_t column = 0; column < width; ++column)
        sums[column] += kernel[k] * static_cast<double>(other[column]);
    }
    std::transform(sums.begin(), sums.end(), row_of(blurred, row), rounded);
  }
  return blurred;
}

}  // namespace af
