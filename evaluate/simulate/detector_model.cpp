// SPDX-License-Identifier: Apache-2.0
#include "evaluate/simulate/detector_model.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/error.h"
#include "base/hash_random.h"
#include "evaluate/simulate/parallel_rows.h"
#include "evaluate/simulate/poisson.h"
#include "xray/bilinear.h"
#include "xray/gaussian_blur.h"

namespace af {

namespace {

/// Means of factor x factor blocks. Blocks at the right and lower edge may be smaller.
Image2d block_means(const Image2d& image, int factor) {
  Image2d means((image.width + factor - 1) / factor, (image.height + factor - 1) / factor);
  for (int row = 0; row < means.height; ++row)
    for (int column = 0; column < means.width; ++column) {
      const int last_row = std::min((row + 1) * factor, image.height);
      const int last_column = std::min((column + 1) * factor, image.width);
      double sum = 0.0;
      for (int y = row * factor; y < last_row; ++y)
        for (int x = column * factor; x < last_column; ++x)
          sum += static_cast<double>(image.at(x, y));
      means.at(column, row) =
          static_cast<float>(sum / ((last_row - row * factor) * (last_column - column * factor)));
    }
  return means;
}

/// Interpolates values at the fine pixel centres.
Image2d magnify(const Image2d& coarse, int factor, int width, int height) {
  const auto coarse_positions = [factor](int count) {
    std::vector<double> positions;
    positions.reserve(static_cast<std::size_t>(count));
    for (int i = 0; i < count; ++i) positions.push_back((i + 0.5) / factor - 0.5);
    return positions;
  };
  return resampled_bilinearly(coarse, coarse_positions(width), coarse_positions(height));
}

double mean_within(const Image2d& image, const RegionOfInterest& roi) {
  double sum = 0.0;
  for (int row = roi.row; row < roi.row + roi.height; ++row)
    for (int column = roi.column; column < roi.column + roi.width; ++column)
      sum += static_cast<double>(image.at(column, row));
  return sum / static_cast<double>(roi.pixel_count());
}

}  // namespace

void DetectorOptions::describe(Fields& field) {
  field("scatter_to_primary",
        scatter_to_primary_ratio,
        "Mean scatter / mean primary within the region of interest")
      .within(0.0, 100.0);
  field.leave_out(scatter_sigma_mm, "the same for every detector");
  field.leave_out(scatter_source, "a stress");
  field.leave_out(heel_ramp, "a stress");
  field("photons_per_pixel",
        photons_per_pixel,
        "Photons per pixel in the open beam, for Poisson noise")
      .such_that("between 1 and 1e12, or 0 for no noise", [](double photons) {
        return photons == 0.0 || (photons >= 1.0 && photons <= 1e12);
      });
  field("blur_sigma_px", blur_sigma_px, "Gaussian detector blur, px").within(0.0, 50.0);
  field("bits", bits, "Grey level bits, 8 to 16; 0: float pixels")
      .such_that("between 8 and 16, or 0 for no quantisation",
                 [](double count) { return count == 0.0 || (count >= 8.0 && count <= 16.0); });
  field("open_beam_level",
        open_beam_level,
        "Grey level of the open beam; levels that --bits cannot hold saturate")
      .within(1.0, 1e6);
}

std::vector<std::string> problems(const DetectorOptions& options) {
  return field_problems(options);
}

Image2d scatter_image(const Image2d& primary,
                      const RegionOfInterest& roi,
                      double pixel_spacing_mm,
                      const DetectorOptions& options) {
  check(problems(roi, primary.width, primary.height).empty(),
        "scatter_image() needs a region within the image");
  Image2d source(primary.width, primary.height);
  if (options.scatter_source == ScatterSource::ObjectAndOpenBeam) {
    source.pixels = primary.pixels;
  } else {
    std::transform(
        primary.pixels.begin(), primary.pixels.end(), source.pixels.begin(), [](float pixel) {
          const auto value = static_cast<double>(pixel);
          return value > 0.0 && value < 1.0 ? static_cast<float>(-value * std::log(value)) : 0.0f;
        });
  }
  // A coarse pixel is a quarter of the kernel's width, so the Gaussian stays well sampled.
  const double sigma_px = options.scatter_sigma_mm / pixel_spacing_mm;
  const int factor = std::max(1, static_cast<int>(sigma_px / 4.0));
  Image2d scatter = magnify(gaussian_blur(block_means(source, factor), sigma_px / factor),
                            factor,
                            primary.width,
                            primary.height);
  const double mean_scatter = mean_within(scatter, roi);
  if (!(mean_scatter > 0.0)) return Image2d(primary.width, primary.height);
  const double scale = options.scatter_to_primary_ratio * mean_within(primary, roi) / mean_scatter;
  for (float& value : scatter.pixels)
    value = static_cast<float>(scale * static_cast<double>(value));
  return scatter;
}

Image2d with_heel_ramp(const Image2d& signal, double heel_ramp) {
  Image2d ramped = signal;
  for (int row = 0; row < signal.height; ++row) {
    const double place = signal.height > 1 ? 2.0 * row / (signal.height - 1) - 1.0 : 1.0;
    const auto gain = static_cast<float>((1.0 + heel_ramp * place) / (1.0 + heel_ramp));
    for (int column = 0; column < signal.width; ++column) ramped.at(column, row) *= gain;
  }
  return ramped;
}

Image2d with_photon_noise(const Image2d& signal,
                          double photons_per_pixel,
                          std::uint64_t seed,
                          std::uint64_t key,
                          int threads) {
  Image2d noisy(signal.width, signal.height);
  for_each_row(signal.height, threads, [&](int row) {
    for (int column = 0; column < signal.width; ++column) {
      const auto pixel =
          static_cast<std::uint64_t>(row) * static_cast<std::uint64_t>(signal.width) +
          static_cast<std::uint64_t>(column);
      HashRandom random(seed, key, pixel);
      const double mean = photons_per_pixel * static_cast<double>(signal.at(column, row));
      noisy.at(column, row) =
          static_cast<float>(static_cast<double>(draw_poisson(mean, random)) / photons_per_pixel);
    }
  });
  return noisy;
}

Image2d digitise(const Image2d& signal, const DetectorOptions& options) {
  Image2d levels(signal.width, signal.height);
  const double highest = std::ldexp(1.0, options.bits) - 1.0;
  for (std::size_t i = 0; i < signal.pixels.size(); ++i) {
    const double level = static_cast<double>(signal.pixels[i]) * options.open_beam_level;
    levels.pixels[i] =
        static_cast<float>(options.bits == 0 ? level : std::clamp(std::round(level), 0.0, highest));
  }
  return levels;
}

Image2d detect(const Image2d& primary,
               const RegionOfInterest& roi,
               double pixel_spacing_mm,
               const DetectorOptions& options,
               std::uint64_t seed,
               std::uint64_t key,
               int threads) {
  Image2d signal = primary;
  if (options.scatter_to_primary_ratio > 0.0) {
    const Image2d scatter = scatter_image(primary, roi, pixel_spacing_mm, options);
    for (std::size_t i = 0; i < signal.pixels.size(); ++i) signal.pixels[i] += scatter.pixels[i];
  }
  if (options.heel_ramp > 0.0) signal = with_heel_ramp(signal, options.heel_ramp);
  if (options.photons_per_pixel > 0.0)
    signal = with_photon_noise(signal, options.photons_per_pixel, seed, key, threads);
  return digitise(gaussian_blur(signal, options.blur_sigma_px), options);
}

}  // namespace af
