// SPDX-License-Identifier: Apache-2.0
#include "evaluate/scan/image_sampling.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "xray/gaussian_blur.h"

namespace af {

namespace {

/// Weights of the four neighbours at -1, 0, 1, 2.
std::array<double, 4> keys_weights(double t) {
  return {((-0.5 * t + 1.0) * t - 0.5) * t,
          (1.5 * t - 2.5) * t * t + 1.0,
          ((-1.5 * t + 2.0) * t + 0.5) * t,
          (0.5 * t - 0.5) * t * t};
}

}  // namespace

double sampled_cubic(const Image2d& image, double column, double row) {
  const double c = std::clamp(column, 0.0, static_cast<double>(image.width - 1));
  const double r = std::clamp(row, 0.0, static_cast<double>(image.height - 1));
  const auto c0 = static_cast<int>(c);
  const auto r0 = static_cast<int>(r);
  const auto across = keys_weights(c - c0);
  const auto down = keys_weights(r - r0);
  double sum = 0.0;
  for (int j = 0; j < 4; ++j) {
    const int y = std::clamp(r0 - 1 + j, 0, image.height - 1);
    double line = 0.0;
    for (int i = 0; i < 4; ++i)
      line += across[static_cast<std::size_t>(i)] *
              static_cast<double>(image.at(std::clamp(c0 - 1 + i, 0, image.width - 1), y));
    sum += down[static_cast<std::size_t>(j)] * line;
  }
  return sum;
}

Image2d binned_image(const Image2d& image, int factor) {
  if (factor == 1) return image;
  Image2d result(image.width / factor, image.height / factor);
  for (int row = 0; row < result.height; ++row)
    for (int column = 0; column < result.width; ++column) {
      double sum = 0.0;
      for (int j = 0; j < factor; ++j)
        for (int i = 0; i < factor; ++i)
          sum += static_cast<double>(image.at(column * factor + i, row * factor + j));
      result.at(column, row) = static_cast<float>(sum / (factor * factor));
    }
  return result;
}

BandPass::BandPass(
    int width, int height, std::vector<unsigned char> is_valid, double fine_px, double coarse_px)
    : is_valid_(std::move(is_valid)), fine_px_(fine_px), coarse_px_(coarse_px) {
  Image2d weights(width, height);
  for (std::size_t i = 0; i < weights.pixels.size(); ++i)
    weights.pixels[i] = is_valid_[i] != 0 ? 1.0F : 0.0F;
  fine_weight_ = gaussian_blur(weights, fine_px);
  coarse_weight_ = gaussian_blur(weights, coarse_px);
}

Image2d BandPass::operator()(const Image2d& image) const {
  Image2d values = image;
  for (std::size_t i = 0; i < values.pixels.size(); ++i)
    if (is_valid_[i] == 0) values.pixels[i] = 0.0F;
  Image2d result = gaussian_blur(values, fine_px_);
  const Image2d coarse = gaussian_blur(values, coarse_px_);
  for (std::size_t i = 0; i < result.pixels.size(); ++i)
    result.pixels[i] = is_valid_[i] == 0 ? 0.0F
                                         : result.pixels[i] / fine_weight_.pixels[i] -
                                               coarse.pixels[i] / coarse_weight_.pixels[i];
  return result;
}

}  // namespace af
