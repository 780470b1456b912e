// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "register/similarity/similarity_measure.h"

namespace af::registration {

inline constexpr int kMaxHistogramBins = 256;

/// Mutual information, in nats, of X-ray and DRR from their joint histogram (Maes et al., IEEE TMI
/// 16(2), 1997; eq. (13) sums it over views):
///
///     MI = sum_ij p_ij log(p_ij / (p_i q_j)) = log N + (sum_ij f(n_ij) - sum_i f(n_i) - sum_j
///     f(m_j)) / N,   f(n) = n log n
///
/// n_ij are integer counts of `bins` x `bins` equal intervals; the X-ray's range is that of its
/// used pixels, the DRR's is given; values beyond it count in the first or last bin. \test
/// MutualInformation.OfAnImageWithItselfIsItsEntropy
class MutualInformation final : public SimilarityMeasure {
 public:
  /// InputError when the reference has problems.
  MutualInformation(const SimilarityReference& reference, int bins);

  [[nodiscard]] double evaluate(std::span<const float> drr,
                                SimilarityWorkspace& workspace) const override;
  [[nodiscard]] std::unique_ptr<SimilarityWorkspace> make_workspace() const override;

 private:
  void count(std::span<const float> drr, std::span<std::uint32_t> joint) const;
  [[nodiscard]] double from_counts(std::span<const std::uint32_t> joint) const;

  int bins_;
  float drr_low_;
  float drr_scale_;                       ///< bins per unit of attenuation
  std::vector<std::uint32_t> xray_rows_;  ///< per pixel: its X-ray bin's first cell of the
                                          ///< histogram; unused pixels have a row of their own
  std::vector<double> n_log_n_;           ///< 0 ... used pixels
  double used_pixels_ = 0.0;
  double xray_sum_ = 0.0;  ///< sum_i f(n_i), which no pose changes
};

}  // namespace af::registration
