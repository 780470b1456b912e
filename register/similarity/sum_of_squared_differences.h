// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "register/similarity/similarity_measure.h"

namespace af::registration {

/// Sum of squared differences as a similarity (Hill et al., Phys. Med. Biol. 46(3), 2001, Sec.
/// 4.2.2). It is the negative mean over the n used pixels, with best value 0:
///
///     SSD = -1/n sum (x - d)^2.
///
/// It needs equal scales: X-rays must be line integrals of the same attenuation.
/// \test SumOfSquaredDifferences.OfAShiftedImageIsMinusTheSquaredShift
class SumOfSquaredDifferences final : public DifferentiableMeasure, public LeastSquaresMeasure {
 public:
  /// Throws InputError when the reference has problems.
  explicit SumOfSquaredDifferences(const SimilarityReference& reference);

  [[nodiscard]] double evaluate(std::span<const float> drr,
                                SimilarityWorkspace& workspace) const override;
  double evaluate_with_derivative(std::span<const float> drr,
                                  std::span<float> derivative,
                                  SimilarityWorkspace& workspace) const override;
  [[nodiscard]] NormalEquations normal_equations(std::span<const float> drr,
                                                 std::span<const float> planes,
                                                 SimilarityWorkspace& workspace) const override;

 private:
  std::vector<float> xray_;     ///< 0 where unused
  std::vector<float> weights_;  ///< 1 where used, 0 elsewhere
  double used_pixels_ = 0.0;
};

}  // namespace af::registration
