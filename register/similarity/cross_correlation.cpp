// SPDX-License-Identifier: Apache-2.0
#include "register/similarity/cross_correlation.h"

#include "base/error.h"
#include "register/similarity/pixel_sums.h"

namespace af::registration {

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
  return correlation_normal_equations(sums);
}

}  // namespace af::registration
