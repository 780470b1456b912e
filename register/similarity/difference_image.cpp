// SPDX-License-Identifier: Apache-2.0
#include "register/similarity/difference_image.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "register/similarity/pixel_sums.h"

namespace af::registration {

DifferenceImage::DifferenceImage(const SimilarityReference& reference)
    : drr_offset_((reference.drr_range.low + reference.drr_range.high) / 2.0) {
  throw_if_any(problems(reference));
  double sum = 0.0;
  ValueRange range{1e300, -1e300};
  for (std::size_t i = 0; i < reference.xray.pixels.size(); ++i) {
    weights_.push_back(reference.is_used(i) ? 1.0f : 0.0f);
    if (!reference.is_used(i)) continue;
    const auto value = static_cast<double>(reference.xray.pixels[i]);
    sum += value;
    range = {std::min(range.low, value), std::max(range.high, value)};
  }
  used_pixels_ = weight_sum(weights_, weights_.size());
  xray_range_ = range.high - range.low;
  const auto mean = static_cast<float>(sum / used_pixels_);
  for (std::size_t i = 0; i < weights_.size(); ++i)
    centered_xray_.push_back(reference.is_used(i) ? reference.xray.pixels[i] - mean : 0.0f);
}

bool DifferenceImage::take(std::span<const float> drr, DifferenceWorkspace& workspace) const {
  check(drr.size() == weights_.size(), "the DRR must have the size of its reference");
  const auto offset = static_cast<float>(drr_offset_);
  const CorrelationSums sums =
      pixel_sum_kernels().correlation_sums(drr.data(),
                                           centered_xray_.data(),
                                           weights_.data(),
                                           offset,
                                           static_cast<std::int32_t>(drr.size()));
  const double mean = sums.value / used_pixels_;
  const double variance = sums.square - sums.value * mean;
  if (!std::isfinite(variance)) return false;
  const double gain = variance > 0.0 ? std::max(0.0, sums.product / variance) : 0.0;
  const auto single_gain = static_cast<float>(gain);
  const auto drr_mean = static_cast<float>(mean + drr_offset_);
  workspace.difference.resize(drr.size());
  for (std::size_t i = 0; i < drr.size(); ++i)
    workspace.difference[i] =
        weights_[i] != 0.0f ? centered_xray_[i] - single_gain * (drr[i] - drr_mean) : 0.0f;
  return true;
}

}  // namespace af::registration
