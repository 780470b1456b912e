// SPDX-License-Identifier: Apache-2.0
#include "register/similarity/cross_correlation.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "register/similarity/pixel_sums.h"

namespace af::registration {
namespace {

/// A constant image leaves rounding errors of this order in its variance: products are rounded to
/// single precision.
constexpr double kRelativeRounding = 1e-6;

}  // namespace

UnitCorrelation correlate(std::span<const float> image,
                          std::span<const float> unit_reference,
                          std::span<const float> weights,
                          double used_pixels,
                          double offset) {
  const auto single_offset = static_cast<float>(offset);
  const CorrelationSums sums =
      pixel_sum_kernels().correlation_sums(image.data(),
                                           unit_reference.data(),
                                           weights.empty() ? nullptr : weights.data(),
                                           single_offset,
                                           static_cast<std::int32_t>(image.size()));
  UnitCorrelation result;
  const double mean = sums.value / used_pixels;
  result.mean = mean + static_cast<double>(single_offset);
  const double variance = sums.square - sums.value * mean;
  if (std::isnan(variance)) result.value = variance;
  if (!(variance > kRelativeRounding * sums.square)) return result;
  result.norm = std::sqrt(variance);
  result.value = sums.product / result.norm;
  return result;
}

void correlation_derivative(const UnitCorrelation& correlation,
                            std::span<const float> image,
                            std::span<const float> unit_reference,
                            std::span<const float> weights,
                            std::span<float> derivative) {
  if (!(correlation.norm > 0.0)) {
    std::fill(derivative.begin(), derivative.end(), 0.0f);
    return;
  }
  const auto mean = static_cast<float>(correlation.mean);
  const auto by_norm = static_cast<float>(1.0 / correlation.norm);
  const auto shrink = static_cast<float>(correlation.value / correlation.norm);
  for (std::size_t i = 0; i < image.size(); ++i) {
    const float slope = by_norm * (unit_reference[i] - shrink * (image[i] - mean));
    derivative[i] = weights.empty() ? slope : weights[i] * slope;
  }
}

CrossCorrelation::CrossCorrelation(const SimilarityReference& reference)
    : drr_offset_((reference.drr_range.low + reference.drr_range.high) / 2.0) {
  throw_if_any(problems(reference));
  weights_ = pixel_weights(reference);
  unit_xray_ = unit_image(reference.xray.pixels, weights_);
  used_pixels_ = weight_sum(weights_, unit_xray_.size());
}

double CrossCorrelation::evaluate(std::span<const float> drr,
                                  SimilarityWorkspace& /*workspace*/) const {
  check(drr.size() == unit_xray_.size(), "the DRR must have the size of its reference");
  return correlate(drr, unit_xray_, weights_, used_pixels_, drr_offset_).value;
}

double CrossCorrelation::evaluate_with_derivative(std::span<const float> drr,
                                                  std::span<float> derivative,
                                                  SimilarityWorkspace& /*workspace*/) const {
  check(drr.size() == unit_xray_.size() && derivative.size() == drr.size(),
        "DRR and derivative must have the size of the reference");
  const UnitCorrelation correlation =
      correlate(drr, unit_xray_, weights_, used_pixels_, drr_offset_);
  correlation_derivative(correlation, drr, unit_xray_, weights_, derivative);
  return correlation.value;
}

NormalEquations CrossCorrelation::normal_equations(std::span<const float> drr,
                                                   std::span<const float> planes,
                                                   SimilarityWorkspace& /*workspace*/) const {
  check(drr.size() == unit_xray_.size(), "the DRR must have the size of its reference");
  const GramSums sums = gram_sums(planes, drr, unit_xray_, weights_, drr_offset_);
  return correlation_normal_equations(
      sums, kRelativeRounding * gram_product(sums, kDrrChannel, kDrrChannel));
}

}  // namespace af::registration
