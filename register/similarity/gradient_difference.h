// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "register/similarity/gradient_images.h"

namespace af::registration {

/// Gradient difference (Penney et al., IEEE TMI 17(4), 1998, eq. (9)), as a mean over the used
/// pixels,
///
///     GD = 1/2 [ mean A_c / (A_c + (x_c - a d_c)^2) + mean A_r / (A_r + (x_r - a d_r)^2) ]   in
///     (0, 1],
///
/// with Sobel's derivatives along columns (c) and rows (r), the variance A of the X-ray's, and the
/// gain a >= 0 from least squares (Penney et al. search for it). \test
/// SimilarityMeasures.ScaledXraysReachTheBestValue
class GradientDifference final : public SimilarityMeasure {
 public:
  /// Throws InputError as GradientReference does, or when the X-ray has no gradient along an axis.
  explicit GradientDifference(const SimilarityReference& reference);

  [[nodiscard]] double evaluate(std::span<const float> drr,
                                SimilarityWorkspace& workspace) const override;
  [[nodiscard]] std::unique_ptr<SimilarityWorkspace> make_workspace() const override;

 private:
  GradientReference reference_;
  std::array<double, 2> variance_{};
};

}  // namespace af::registration
