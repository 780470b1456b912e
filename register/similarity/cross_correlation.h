// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include "register/similarity/similarity_measure.h"

namespace af::registration {

/// Normalised cross correlation of X-ray and DRR (Penney et al., IEEE TMI 17(4), 1998, eq. (4)):
///
///     NCC = sum (x - mean x)(d - mean d) / sqrt(sum (x - mean x)^2 sum (d - mean d)^2)
///
/// over the used pixels, from -1 to 1; 0 when the DRR is constant there. With x^ and d^ the centred
/// images of norm 1, NCC = 1 - |x^ - d^|^2 / 2. This is a sum of squares, in whose normal equations
/// gain and offset do not enter. \test CrossCorrelation.IsOneForAnyRisingLinearMap
class CrossCorrelation final : public DifferentiableMeasure, public LeastSquaresMeasure {
 public:
  /// Throws InputError when the reference has problems.
  explicit CrossCorrelation(const SimilarityReference& reference);

  [[nodiscard]] double evaluate(std::span<const float> drr,
                                SimilarityWorkspace& workspace) const override;
  double evaluate_with_derivative(std::span<const float> drr,
                                  std::span<float> derivative,
                                  SimilarityWorkspace& workspace) const override;
  [[nodiscard]] NormalEquations normal_equations(std::span<const float> drr,
                                                 std::span<const float> planes,
                                                 SimilarityWorkspace& workspace) const override;

 private:
  std::vector<float> weights_;    ///< 1 where used, 0 elsewhere; empty: all are
  std::vector<float> unit_xray_;  ///< (x - mean) / norm; 0 where unused
  double used_pixels_ = 0.0;
  double drr_offset_ = 0.0;  ///< subtracted before squaring, against cancellation
};

}  // namespace af::registration
