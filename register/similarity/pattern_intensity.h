// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "register/similarity/difference_image.h"

namespace af::registration {

/// Pattern intensity (Weese et al., Proc. CVRMed-MRCAS 1997; Penney et al., IEEE TMI 17(4), 1998,
/// eq. (8)) of the difference image e = x - a d - b (gain and offset by least squares), as a mean
/// over the pairs,
///
///     PI = mean over |i - j| <= r of s^2 / (s^2 + (e_i - e_j)^2)   in (0, 1],
///
/// with r = 3 pixels and s = 10 grey levels of 256 over the X-ray's range. Both pixels of a pair
/// must be used. \test SimilarityMeasures.ScaledXraysReachTheBestValue
class PatternIntensity final : public SimilarityMeasure {
 public:
  /// Throws InputError when the reference has problems, or no pair of used pixels is near enough.
  explicit PatternIntensity(const SimilarityReference& reference);

  [[nodiscard]] double evaluate(std::span<const float> drr,
                                SimilarityWorkspace& workspace) const override;
  [[nodiscard]] std::unique_ptr<SimilarityWorkspace> make_workspace() const override;

 private:
  DifferenceImage difference_;
  int width_;
  int height_;
  double pairs_ = 0.0;
};

}  // namespace af::registration
