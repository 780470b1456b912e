// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "xray/image2d.h"

namespace af {

/// Gaussian smoothing with standard deviation `sigma_px`. The kernel is cut at 4 sigma and
/// normalised to sum 1; edges are replicated. sigma_px <= 0 returns the image unchanged.
Image2d gaussian_blur(const Image2d& image, double sigma_px);

/// How many pixels away a value still counts; 0 for sigma_px <= 0.
int blur_radius_px(double sigma_px);

}  // namespace af
