// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "register/similarity/joint_histogram.h"

namespace af::registration {

/// Mutual information, in nats, of X-ray and DRR from their joint histogram (Maes et al., IEEE TMI
/// 16(2), 1997; eq. (13) sums it over views):
///
///     MI = H(x) + H(d) - H(x, d) = sum_ij p_ij log(p_ij / (p_i q_j))
///
/// \test MutualInformation.OfAnImageWithItselfIsItsEntropy
class MutualInformation final : public JointHistogramMeasure {
 public:
  /// InputError when the reference has problems. `is_smooth`: see JointHistogramMeasure.
  MutualInformation(const SimilarityReference& reference, int bins, bool is_smooth = false)
      : JointHistogramMeasure(reference, bins, is_smooth) {}

 protected:
  [[nodiscard]] EntropyScore score(const JointEntropies& entropies) const override {
    return {entropies.xray + entropies.drr - entropies.joint, 1.0, -1.0};
  }
};

}  // namespace af::registration
