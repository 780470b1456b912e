// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "register/similarity/difference_image.h"

namespace af::registration {

/// Entropy of the difference image as a similarity (Buzug et al., Proc. CVRMed-MRCAS 1997; Penney
/// et al., IEEE TMI 17(4), 1998, eq. (6)): minus the entropy, in nats, of the histogram of e = x -
/// a d - b (gain and offset by least squares),
///
///     S = sum_k p_k log p_k   <= 0,
///
/// over `bins` bins from minus to plus the X-ray's range. Values beyond count in the outermost
/// bins. \test SimilarityMeasures.ScaledXraysReachTheBestValue
class DifferenceEntropy final : public SimilarityMeasure {
 public:
  /// Throws InputError when the reference has problems.
  DifferenceEntropy(const SimilarityReference& reference, int bins);

  [[nodiscard]] double evaluate(std::span<const float> drr,
                                SimilarityWorkspace& workspace) const override;
  [[nodiscard]] std::unique_ptr<SimilarityWorkspace> make_workspace() const override;

 private:
  DifferenceImage difference_;
  int bins_;
};

}  // namespace af::registration
