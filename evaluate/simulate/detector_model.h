// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "base/described_fields.h"
#include "xray/image2d.h"

namespace af {

/// The source of scatter: the object alone, or also the open beam beside it (air, walls, glare).
enum class ScatterSource { Object, ObjectAndOpenBeam };

/// What the detector adds to the primary beam. A value of 0 switches its effect off.
struct DetectorOptions {
  double scatter_to_primary_ratio = 0.3;  ///< mean scatter / mean primary within the ROI
  double scatter_sigma_mm = 40.0;         ///< width of the scatter kernel on the detector
  ScatterSource scatter_source = ScatterSource::Object;
  double heel_ramp = 0.0;          ///< h: the beam grows by (1+h)/(1-h) from first to last row
  double photons_per_pixel = 2e5;  ///< in the open beam
  double blur_sigma_px = 0.6;
  int bits = 12;                    ///< 0: pixels are not quantised
  double open_beam_level = 4000.0;  ///< grey value of the open beam

  void describe(Fields& field);
};

std::vector<std::string> problems(const DetectorOptions& options);

/// Scatter that reaches the detector, in units of the open beam. Its source is primary * -ln
/// primary: what the object removed from the beam and what it lets through (B. Ohnesorge et al.,
/// Eur. Radiol. 9:563, 1999). A Gaussian spreads it on a decimated grid, and it is scaled to the
/// stated ratio within `roi`. The open beam is no source. With ScatterSource::ObjectAndOpenBeam the
/// source is the primary itself, so that what passes beside the object veils its shadow.
Image2d scatter_image(const Image2d& primary,
                      const RegionOfInterest& roi,
                      double pixel_spacing_mm,
                      const DetectorOptions& options);

/// The signal under a beam that grows linearly over the rows (the anode's heel effect), from
/// (1-h)/(1+h) on the first row to 1 on the last. The brightest part keeps the open beam's level.
Image2d with_heel_ramp(const Image2d& signal, double heel_ramp);

/// Replaces every pixel by a Poisson count around photons_per_pixel * value, divided by
/// photons_per_pixel. Keyed by (seed, key, pixel).
Image2d with_photon_noise(const Image2d& signal,
                          double photons_per_pixel,
                          std::uint64_t seed,
                          std::uint64_t key,
                          int threads);

/// Grey values: signal * open_beam_level, rounded and clamped to the bits (neither with 0 bits).
Image2d digitise(const Image2d& signal, const DetectorOptions& options);

/// The X-ray of a primary image: scatter, heel effect, noise, blur, grey values, in this order.
Image2d detect(const Image2d& primary,
               const RegionOfInterest& roi,
               double pixel_spacing_mm,
               const DetectorOptions& options,
               std::uint64_t seed,
               std::uint64_t key,
               int threads);

}  // namespace af
