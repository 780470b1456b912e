// SPDX-License-Identifier: Apache-2.0
#include "field/attenuation_quantizer.h"

#include <cmath>

#include "base/error.h"

namespace af {

AttenuationQuantizer::AttenuationQuantizer(float step) : step_(step) {
  check(step > 0.0f && std::isfinite(step), "the quantiser's step must be positive and finite");
}

AttenuationQuantizer AttenuationQuantizer::for_maximum(double max_total_attenuation) {
  return AttenuationQuantizer(static_cast<float>(max_total_attenuation / 65535.0));
}

std::uint16_t AttenuationQuantizer::quantize(float total_attenuation) const {
  const float level = total_attenuation / step_ + 0.5f;
  if (!(level > 0.0f)) return 0;
  return level >= 65535.0f ? std::uint16_t{65535} : static_cast<std::uint16_t>(level);
}

}  // namespace af
