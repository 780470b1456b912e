// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "register/similarity/gradient_images.h"

namespace af::registration {

/// Gradient correlation (Penney et al., IEEE TMI 17(4), 1998, Sec. II-C): the mean of the cross
/// correlations of the images' derivatives along columns and along rows (Sobel),
///
///     GC = (NCC(x_c, d_c) + NCC(x_r, d_r)) / 2   in [-1, 1],
///
/// over the pixels whose 3 x 3 neighbours are all in use. A sum of squares like NCC.
/// \test GradientCorrelation.HardlyNoticesASlowRamp
class GradientCorrelation final : public DifferentiableMeasure, public LeastSquaresMeasure {
 public:
  /// Throws InputError as GradientReference does.
  explicit GradientCorrelation(const SimilarityReference& reference);

  [[nodiscard]] double evaluate(std::span<const float> drr,
                                SimilarityWorkspace& workspace) const override;
  double evaluate_with_derivative(std::span<const float> drr,
                                  std::span<float> derivative,
                                  SimilarityWorkspace& workspace) const override;
  [[nodiscard]] NormalEquations normal_equations(std::span<const float> drr,
                                                 std::span<const float> planes,
                                                 SimilarityWorkspace& workspace) const override;
  [[nodiscard]] std::unique_ptr<SimilarityWorkspace> make_workspace() const override;

 private:
  GradientReference reference_;
  GradientPair unit_xray_;
};

}  // namespace af::registration
