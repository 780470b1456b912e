// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "register/similarity/gradient_images.h"

namespace af::registration {

/// Robust gradient residuals: how much of the X-ray's gradients a DRR explains, judged by a cost
/// that saturates (Geman and McClure; as an M-estimator in Black and Rangarajan, IJCV 19(1), 1996),
///
///     RG = 1 - sum rho(x_i - a d_i) / sum rho(x_i),   rho(r) = r^2 / (s^2 + r^2),
///
/// over Sobel's derivatives along columns and rows at the used pixels. The gain a >= 0 of the view
/// is eliminated: it comes from least squares, refined by a fixed number of reweighted steps. A
/// perfect DRR has 1, and no DRR at all (a = 0) has 0. The contribution of occluders, which a DRR
/// cannot show, is bounded. s = `residual_scale` times the median length of the X-ray's gradients.
///
/// Its normal equations take the weights as constant. With rho'' in place of rho' / r they become
/// the curvature (after the gain has followed, except for a term that vanishes with the gradient).
/// \test RobustGradient.OccludersCostABoundedPrice,
/// RobustGradient.CurvesLessThanItsNormalEquationsByTheReweighting
class RobustGradient final : public DifferentiableMeasure, public LeastSquaresMeasure {
 public:
  /// Throws InputError as GradientReference does, or when most of the X-ray has no gradient.
  RobustGradient(const SimilarityReference& reference, double residual_scale);

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
  [[nodiscard]] RobustSums sums_at(const GradientPair& drr, double gain) const;
  [[nodiscard]] double gain_of(const GradientPair& drr) const;
  /// Fills workspace.robust_weights and .curvature_weights with the weights of one direction, and
  /// returns its part of the cost.
  double take_weights(int direction, double gain, GradientWorkspace& workspace) const;

  GradientReference reference_;
  double squared_scale_ = 0.0;
  double cost_without_drr_ = 0.0;
};

}  // namespace af::registration
