// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "image/image2d.h"

namespace af {

/// What the detector adds to the primary beam. A value of 0 switches its effect off.
struct DetectorOptions {
  double scatter_to_primary_ratio = 0.3;  ///< mean scatter / mean primary within the ROI
  double scatter_sigma_mm = 40.0;         ///< width of the scatter kernel on the detector
  double photons_per_pixel = 2e5;         ///< in the open beam
  double blur_sigma_px = 0.6;
  int bits = 12;                    ///< 0: pixels are not quantised
  double open_beam_level = 4000.0;  ///< grey value of the open beam
};

std::vector<std::string> problems(const DetectorOptions& options);

/// Scatter that reaches the detector, in units of the open beam: its source is primary * -ln
/// primary (what the object removed from the beam and what it lets through; B. Ohnesorge et al.,
/// Eur. Radiol. 9:563, 1999), spread by a Gaussian on a decimated grid and scaled to the stated
/// ratio within `roi`. The open beam is no source.
Image2d scatter_image(const Image2d& primary,
                      const RegionOfInterest& roi,
                      double pixel_spacing_mm,
                      const DetectorOptions& options);

/// Every pixel replaced by a Poisson count around photons_per_pixel * value, divided by
/// photons_per_pixel; keyed by (seed, key, pixel).
Image2d with_photon_noise(const Image2d& signal,
                          double photons_per_pixel,
                          std::uint64_t seed,
                          std::uint64_t key,
                          int threads);

/// Grey values: signal * open_beam_level, rounded and clamped to the bits (0 bits: neither).
Image2d digitise(const Image2d& signal, const DetectorOptions& options);

/// The X-ray of a primary image: scatter, noise, blur, grey values, in this order.
Image2d detect(const Image2d& primary,
               const RegionOfInterest& roi,
               double pixel_spacing_mm,
               const DetectorOptions& options,
               std::uint64_t seed,
               std::uint64_t key,
               int threads);

}  // namespace af
