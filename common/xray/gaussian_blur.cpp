// SPDX-License-Identifier: Apache-2.0
#include "xray/gaussian_blur.h"

#include <algorithm>
#include <cmath>

namespace af {

namespace {

std::vector<double> gaussian_kernel(double sigma_px) {
  const int radius = std::max(1, static_cast<int>(std::ceil(4.0 * sigma_px)));
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

Image2d gaussian_blur(const Image2d& image, double sigma_px) {
  if (!(sigma_px > 0.0)) return image;
  const std::vector<double> kernel = gaussian_kernel(sigma_px);
  const int radius = static_cast<int>(kernel.size() / 2);
  Image2d along_rows(image.width, image.height);
  Image2d blurred(image.width, image.height);
  for (int row = 0; row < image.height; ++row)
    for (int column = 0; column < image.width; ++column) {
      double sum = 0.0;
      for (int i = -radius; i <= radius; ++i)
        sum += kernel[static_cast<std::size_t>(i) + static_cast<std::size_t>(radius)] *
               static_cast<double>(image.at(std::clamp(column + i, 0, image.width - 1), row));
      along_rows.at(column, row) = static_cast<float>(sum);
    }
  for (int row = 0; row < image.height; ++row)
    for (int column = 0; column < image.width; ++column) {
      double sum = 0.0;
      for (int i = -radius; i <= radius; ++i)
        sum += kernel[static_cast<std::size_t>(i) + static_cast<std::size_t>(radius)] *
               static_cast<double>(along_rows.at(column, std::clamp(row + i, 0, image.height - 1)));
      blurred.at(column, row) = static_cast<float>(sum);
    }
  return blurred;
}

}  // namespace af
