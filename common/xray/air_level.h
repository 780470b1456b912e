// SPDX-License-Identifier: Apache-2.0
// Turns intensities into line integrals. That needs the reading of the detector where nothing is in
// the beam.
#pragma once

#include <optional>
#include <vector>

#include "xray/image2d.h"

namespace af {

struct AirLevel {
  double level = 0.0;
  double share = 0.0;  ///< share of the examined pixels within 10 % of the level
};

/// The level of the open beam. It is the brightest peak of the histogram of log intensity that
/// holds at least 3 % of the pixels within 10 % of it; nullopt when there is none. Where no air is
/// in view, a large even part of the patient can be taken for it.
std::optional<AirLevel> open_beam_peak(const std::vector<float>& intensities);

/// The air beside a collimated field's edge: the 90th percentile of a band along the edge, 5 % of
/// the shorter side wide. `mask` (1 = field) must hide something. When it hides everything along an
/// edge, the level is 0.
AirLevel air_beside_edge(const Image2d& intensity, const Image2d& mask);

/// Where the pixels along the field's edge lie between the picture's 1st and 99th percentile.
enum class Background { Bright, Dark, Undecided };

/// Bright when the median along the edge of the field lies beyond 75 % of that range, dark below 25
/// %. `mask`: 1 = field; empty: everything.
Background background_of(const Image2d& image, const Image2d& mask);

/// How much finer detail the brightest quarter of the field has than the darkest: the base-2
/// logarithm of the ratio of their mean details. A pixel's detail is the smaller of its second
/// differences along rows and along columns. Clipped values, at either end of the scale, are left
/// out. Photons, and what attenuates them, make more detail where there are more photons. The
/// result is therefore above 0 for intensities and below 0 for a negative. It is 0 where there is
/// none to compare.
double bright_detail(const Image2d& image, const Image2d& mask);

/// (image - dark) / (flat - dark) for pixels with flat > dark; others get 0. The images have one
/// size. An empty `dark` stands for 0.
Image2d flat_corrected(const Image2d& image, const Image2d& flat, const Image2d& dark);

/// -log(I / air). Intensities that are not positive count as half of the smallest step that the
/// values can have: half a grey level for integers, otherwise half of the smallest positive value.
void take_negative_log(Image2d& image, double air_level);

}  // namespace af
