// SPDX-License-Identifier: Apache-2.0
#include "study/xray_reader.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "image_files/image_file.h"

namespace af {

namespace {

/// Share of pixels that are no brighter than what counts as the open beam.
constexpr double kOpenBeamShare = 0.999;

void check_size(const Image2d& image, const std::string& file, const CameraGeometry& camera) {
  if (image.width != camera.size_px.x() || image.height != camera.size_px.y())
    throw InputError("size",
                     std::to_string(image.width) + " x " + std::to_string(image.height) + " px",
                     "must be that of camera '" + camera.name +
                         "': " + std::to_string(camera.size_px.x()) + " x " +
                         std::to_string(camera.size_px.y()) + " px",
                     file);
}

/// The smallest value that the given share of the pixels does not exceed.
float nearest_rank(std::vector<float> values, double share) {
  const auto rank = static_cast<std::size_t>(
      std::max(1.0, std::ceil(share * static_cast<double>(values.size()))));
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(rank - 1);
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

/// Half of the smallest step that an image's values can have: half a grey level of integers, half
/// of the smallest positive value otherwise.
double half_level(const std::vector<float>& values) {
  float smallest_positive = 0.0f;
  bool integers = true;
  for (const float value : values) {
    integers = integers && value == std::nearbyint(value);
    if (value > 0.0f && (smallest_positive == 0.0f || value < smallest_positive))
      smallest_positive = value;
  }
  return integers ? 0.5 : 0.5 * static_cast<double>(smallest_positive);
}

void check_values(const Image2d& image, const StudyView& view) {
  const std::string file = view.xray.string();
  for (std::size_t i = 0; i < image.pixels.size(); ++i) {
    const float value = image.pixels[i];
    if (view.xray_domain != XrayDomain::Intensity || value >= 0.0f) continue;
    const auto width = static_cast<std::size_t>(image.width);
    throw InputError("pixel (" + std::to_string(i % width) + ", " + std::to_string(i / width) + ")",
                     std::to_string(value),
                     "intensities must not be negative (xray_domain = \"attenuation\"?)",
                     file);
  }
  const auto [low, high] = std::minmax_element(image.pixels.begin(), image.pixels.end());
  if (*low == *high)
    throw InputError(
        "pixels", "all " + std::to_string(*low), "a constant image shows nothing", file);
}

void take_negative_log(Image2d& image, const std::string& file) {
  const double open_beam = static_cast<double>(nearest_rank(image.pixels, kOpenBeamShare));
  if (!(open_beam > 0.0))
    throw InputError("open-beam intensity (99.9th percentile)",
                     std::to_string(open_beam),
                     "must be positive",
                     file);
  const double zero = half_level(image.pixels);
  for (float& pixel : image.pixels) {
    const double intensity = pixel > 0.0f ? static_cast<double>(pixel) : zero;
    pixel = static_cast<float>(-std::log(intensity / open_beam));
  }
}

}  // namespace

Image2d read_xray_attenuation(const StudyView& view, const CameraGeometry& camera) {
  Image2d image = read_image(view.xray);
  check_size(image, view.xray.string(), camera);
  check_values(image, view);
  if (view.xray_domain == XrayDomain::Intensity) take_negative_log(image, view.xray.string());
  return image;
}

Image2d read_mask(const StudyView& view, const CameraGeometry& camera) {
  if (!view.mask) return {};
  Image2d mask = read_image(*view.mask);
  check_size(mask, view.mask->string(), camera);
  if (std::none_of(mask.pixels.begin(), mask.pixels.end(), [](float v) { return v != 0.0f; }))
    throw InputError("mask", "all 0", "must let at least one pixel through", view.mask->string());
  return mask;
}

}  // namespace af
