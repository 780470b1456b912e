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

/// Eq. (12): 20 log10(I_max / RMS difference), where I_max is the reference's maximum. Pixels whose
/// reference is exactly 0 are left out, because their ray meets no attenuating matter. nullopt when
/// no pixel is foreground.
std::optional<Psnr> psnr(std::span<const float> drr, std::span<const float> reference);

}  // namespace af
