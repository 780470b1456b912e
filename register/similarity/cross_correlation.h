// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "register/similarity/similarity_measure.h"

namespace af::registration {

/// Normalised cross correlation of X-ray and DRR (Penney et al., IEEE TMI 17(4), 1998, eq. (4)):
///
///     NCC = sum (x - mean x)(d - mean d) / sqrt(sum (x - mean x)^2 sum (d - mean d)^2)   in [-1,
///     1]
///
/// over the used pixels; 0 when the DRR is constant there. Sums run in double in a fixed order.
/// \test CrossCorrelation.IsOneForAnyRisingLinearMap
class CrossCorrelation final : public SimilarityMeasure {
 public:
  /// InputError when the reference has problems.
  explicit CrossCorrelation(const SimilarityReference& reference);

  [[nodiscard]] double evaluate(std::span<const float> drr,
                                SimilarityWorkspace& workspace) const override;
  [[nodiscard]] std::unique_ptr<SimilarityWorkspace> make_workspace() const override;

 private:
  std::vector<float> unit_xray_;  ///< (x - mean) / norm; 0 where unused
  std::vector<float> weights_;    ///< 1 where used, 0 elsewhere
  double used_pixels_ = 0.0;
  double drr_offset_ = 0.0;  ///< subtracted before squaring, against cancellation
};

}  // namespace af::registration
