// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <optional>
#include <span>

namespace af {

/// Peak signal-to-noise ratio of one DRR against its reference.
struct Psnr {
  double psnr_db = 0.0;              ///< infinity when the images are equal
  double rms_difference = 0.0;       ///< over the foreground
  double reference_maximum = 0.0;    ///< I_max
  double foreground_fraction = 0.0;  ///< share of pixels whose reference value is not 0
};

/// Eq. (12): 20 log10(I_max / RMS difference), I_max the reference's maximum; pixels whose
/// reference is exactly 0 (their ray meets no attenuating matter) are left out. nullopt when no
/// pixel is foreground.
std::optional<Psnr> psnr(std::span<const float> drr, std::span<const float> reference);

}  // namespace af
