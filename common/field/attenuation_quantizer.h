// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

namespace af {

/// Uniform 16-bit quantiser of total attenuation: q = round(U / step). q is 0 only for U below half
/// a step.
class AttenuationQuantizer {
 public:
  /// `step` > 0: attenuation per level, dimensionless.
  explicit AttenuationQuantizer(float step);
  /// The step that maps [0, max_total_attenuation] to 0 ... 65535.
  static AttenuationQuantizer for_maximum(double max_total_attenuation);

  [[nodiscard]] float step() const { return step_; }
  /// Rounds to the nearest level, as quantize_node() of shear_warp_kernel does.
  [[nodiscard]] std::uint16_t quantize(float total_attenuation) const;
  [[nodiscard]] float dequantize(std::uint16_t level) const {
    return step_ * static_cast<float>(level);
  }

 private:
  float step_ = 0.0f;
};

}  // namespace af
