// SPDX-License-Identifier: Apache-2.0
#include "xray/psnr.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"

namespace af {

std::optional<Psnr> psnr(std::span<const float> drr, std::span<const float> reference) {
  check(drr.size() == reference.size(), "psnr() needs images of one size");
  Psnr result;
  double sum_of_squares = 0.0;
  std::size_t foreground = 0;
  for (std::size_t i = 0; i < drr.size(); ++i) {
    if (reference[i] == 0.0f) continue;
    ++foreground;
    const double difference = static_cast<double>(drr[i]) - static_cast<double>(reference[i]);
    sum_of_squares += difference * difference;
    result.reference_maximum =
        std::max(result.reference_maximum, static_cast<double>(reference[i]));
  }
  if (foreground == 0) return std::nullopt;
  result.foreground_fraction = static_cast<double>(foreground) / static_cast<double>(drr.size());
  result.rms_difference = std::sqrt(sum_of_squares / static_cast<double>(foreground));
  result.psnr_db = 20.0 * std::log10(result.reference_maximum / result.rms_difference);
  return result;
}

}  // namespace af
