// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "register/similarity/gradient_images.h"

namespace af::registration {

/// Gradient orientation (De Silva et al., Phys. Med. Biol. 61(8), 2016, eq. (4)):
///
///     GO = 1/max(N, N_low) sum_i w(angle_i),   w(a) = (2 - ln(1 + |a|)) / 2
///
/// over the N pixels where the gradients (Sobel) of both images are longer than the medians of
/// their lengths. angle_i (rad) is the angle between the two gradients, N_low half of the used
/// pixels. At most 1. Only directions count: gain, offset and rising changes of contrast have no
/// effect.
/// \test SimilarityMeasures.GainAndOffsetDoNotCountWhereTheyAreEliminated
class GradientOrientation final : public SimilarityMeasure {
 public:
  /// Throws InputError as GradientReference does.
  explicit GradientOrientation(const SimilarityReference& reference);

  [[nodiscard]] double evaluate(std::span<const float> drr,
                                SimilarityWorkspace& workspace) const override;
  [[nodiscard]] std::unique_ptr<SimilarityWorkspace> make_workspace() const override;

 private:
  GradientReference reference_;
  std::vector<float> strong_xray_;  ///< 1 where used and the X-ray's gradient beats its median
};

}  // namespace af::registration
