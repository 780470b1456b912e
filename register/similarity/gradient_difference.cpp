// SPDX-License-Identifier: Apache-2.0
#include "register/similarity/gradient_difference.h"

#include <cmath>

#include "base/error.h"

namespace af::registration {

GradientDifference::GradientDifference(const SimilarityReference& reference)
    : reference_(reference) {
  for (int direction = 0; direction < 2; ++direction) {
    const std::vector<float>& x = reference_.xray.of(direction);
    const CorrelationSums sums = pixel_sum_kernels().correlation_sums(
        x.data(), x.data(), reference_.weights.data(), 0.0f, static_cast<std::int32_t>(x.size()));
    const double mean = sums.value / reference_.used_pixels;
    const double variance = sums.square / reference_.used_pixels - mean * mean;
    if (!(variance > 0.0))
      throw InputError("X-ray = no gradient along an axis of the region: gd needs one");
    variance_[static_cast<std::size_t>(direction)] = variance;
  }
}

double GradientDifference::evaluate(std::span<const float> drr,
                                    SimilarityWorkspace& workspace) const {
  auto& mine = dynamic_cast<GradientWorkspace&>(workspace);
  take_gradients(reference_, drr, mine);
  const double gain = least_squares_gain(reference_, mine.drr);
  double sum = 0.0;
  for (int direction = 0; direction < 2; ++direction)
    // A / (A + r^2) = 1 - r^2 / (A + r^2).
    sum += 1.0 -
           pixel_sum_kernels()
                   .robust_sums({reference_.xray.of(direction).data(),
                                 mine.drr.of(direction).data(),
                                 reference_.weights.data(),
                                 static_cast<float>(gain),
                                 static_cast<float>(variance_[static_cast<std::size_t>(direction)]),
                                 nullptr,
                                 nullptr},
                                static_cast<std::int32_t>(drr.size()))
                   .cost /
               reference_.used_pixels;
  return sum / 2.0;
}

std::unique_ptr<SimilarityWorkspace> GradientDifference::make_workspace() const {
  return make_gradient_workspace(reference_);
}

}  // namespace af::registration
