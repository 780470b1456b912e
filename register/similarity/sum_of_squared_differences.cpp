// SPDX-License-Identifier: Apache-2.0
#include "register/similarity/sum_of_squared_differences.h"

#include "base/error.h"
#include "register/similarity/pixel_sums.h"

namespace af::registration {

SumOfSquaredDifferences::SumOfSquaredDifferences(const SimilarityReference& reference) {
  throw_if_any(problems(reference));
  for (std::size_t i = 0; i < reference.xray.pixels.size(); ++i) {
    xray_.push_back(reference.is_used(i) ? reference.xray.pixels[i] : 0.0f);
    weights_.push_back(reference.is_used(i) ? 1.0f : 0.0f);
  }
  used_pixels_ = weight_sum(weights_, weights_.size());
}

double SumOfSquaredDifferences::evaluate(std::span<const float> drr,
                                         SimilarityWorkspace& /*workspace*/) const {
  check(drr.size() == xray_.size(), "the DRR must have the size of its reference");
  double sum = 0.0;
  for (std::size_t i = 0; i < drr.size(); ++i) {
    const auto difference = static_cast<double>(weights_[i] * (xray_[i] - drr[i]));
    sum += difference * difference;
  }
  return -sum / used_pixels_;
}

double SumOfSquaredDifferences::evaluate_with_derivative(std::span<const float> drr,
                                                         std::span<float> derivative,
                                                         SimilarityWorkspace& workspace) const {
  const auto scale = static_cast<float>(2.0 / used_pixels_);
  check(derivative.size() == drr.size(), "one derivative per pixel");
  const double value = evaluate(drr, workspace);
  for (std::size_t i = 0; i < drr.size(); ++i)
    derivative[i] = scale * weights_[i] * (xray_[i] - drr[i]);
  return value;
}

NormalEquations SumOfSquaredDifferences::normal_equations(
    std::span<const float> drr,
    std::span<const float> planes,
    SimilarityWorkspace& /*workspace*/) const {
  check(drr.size() == xray_.size(), "the DRR must have the size of its reference");
  const GramSums sums = gram_sums(planes, drr, xray_, weights_);
  NormalEquations result;
  result.value = -(gram_product(sums, kXrayChannel, kXrayChannel) -
                   2.0 * gram_product(sums, kXrayChannel, kDrrChannel) +
                   gram_product(sums, kDrrChannel, kDrrChannel)) /
                 used_pixels_;
  for (int k = 0; k < 6; ++k) {
    result.gradient[k] = 2.0 / used_pixels_ *
                         (gram_product(sums, k, kXrayChannel) - gram_product(sums, k, kDrrChannel));
    for (int l = 0; l < 6; ++l) result.matrix(k, l) = 2.0 / used_pixels_ * gram_product(sums, k, l);
  }
  return result;
}

}  // namespace af::registration
