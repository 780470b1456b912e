// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "register/similarity/similarity_measure.h"

namespace af::registration {

inline constexpr int kMaxHistogramBins = 256;

/// Entropies, in nats, of the X-ray, the DRR and both together.
struct JointEntropies {
  double xray = 0.0;
  double drr = 0.0;
  double joint = 0.0;
};

/// What a similarity makes of the entropies, and its derivatives by those of DRR and pair.
struct EntropyScore {
  double value = 0.0;
  double by_drr = 0.0;
  double by_joint = 0.0;
};

/// Base of the measures that look at the joint histogram of X-ray and DRR: `bins` x `bins` equal
/// intervals. The X-ray's range is that of its used pixels, the DRR's is given; values beyond it
/// count in the first or last bin.
///
/// Plain: integer counts n_ij, -sum p log p = log N - sum f(n) / N with f(n) = n log n. Smooth: a
/// DRR value counts in four bins by a cubic B-spline window (Thevenaz and Unser, IEEE TIP 9(12),
/// 2000; Mattes et al., IEEE TMI 22(1), 2003), its range mapped to the bins that have a neighbour
/// on one side and two on the other, which makes every score differentiable.
class JointHistogramMeasure : public SimilarityMeasure {
 public:
  [[nodiscard]] double evaluate(std::span<const float> drr,
                                SimilarityWorkspace& workspace) const override;
  double evaluate_with_derivative(std::span<const float> drr,
                                  std::span<float> derivative,
                                  SimilarityWorkspace& workspace) const override;
  [[nodiscard]] std::unique_ptr<SimilarityWorkspace> make_workspace() const override;

 protected:
  /// InputError when the reference has problems.
  JointHistogramMeasure(const SimilarityReference& reference, int bins, bool is_smooth);

  [[nodiscard]] virtual EntropyScore score(const JointEntropies& entropies) const = 0;

 private:
  class Workspace;
  [[nodiscard]] JointEntropies plain_entropies(std::span<const float> drr, Workspace& mine) const;
  [[nodiscard]] JointEntropies smooth_entropies(std::span<const float> drr, Workspace& mine) const;
  void count_smoothly(std::span<const float> drr, Workspace& mine) const;

  int bins_;
  bool is_smooth_;
  float drr_low_ = 0.0f;
  float bins_per_unit_ = 0.0f;
  std::vector<std::uint32_t> xray_rows_;  ///< per pixel: its X-ray bin's first cell of the
                                          ///< histogram; unused pixels have a row of their own
  std::vector<double> n_log_n_;           ///< 0 ... used pixels
  double used_pixels_ = 0.0;
  double xray_entropy_ = 0.0;  ///< which no pose changes
};

}  // namespace af::registration
