// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "register/similarity/joint_histogram.h"

namespace af::registration {

/// Normalised mutual information (Studholme et al., Pattern Recognition 32(1), 1999),
///
///     NMI = (H(x) + H(d)) / H(x, d)   in [1, 2],
///
/// 1 when the images know nothing of each other (and when both are constant), 2 when each is a
/// function of the other. Less than MI it rewards the mere overlap of varied regions.
/// \test NormalizedMutualInformation.IsTwoForAnImageWithItself
class NormalizedMutualInformation final : public JointHistogramMeasure {
 public:
  /// InputError when the reference has problems. `is_smooth`: see JointHistogramMeasure.
  NormalizedMutualInformation(const SimilarityReference& reference,
                              int bins,
                              bool is_smooth = false)
      : JointHistogramMeasure(reference, bins, is_smooth) {}

 protected:
  [[nodiscard]] EntropyScore score(const JointEntropies& entropies) const override {
    if (!(entropies.joint > 0.0)) return {1.0, 0.0, 0.0};
    const double value = (entropies.xray + entropies.drr) / entropies.joint;
    return {value, 1.0 / entropies.joint, -value / entropies.joint};
  }
};

}  // namespace af::registration
