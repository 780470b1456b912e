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

/// A similarity computed from the entropies, and its derivatives with respect to the DRR's and the
/// joint one.
struct EntropyScore {
  double value = 0.0;
  double by_drr = 0.0;
  double by_joint = 0.0;
};

/// Base of the measures that use the joint histogram of X-ray and DRR, with `bins` x `bins` equal
/// intervals. The X-ray's range is that of its used pixels, and the DRR's is given. Values beyond
/// it count in the first or last bin.
///
/// Plain: integer counts n_ij, -sum p log p = log N - sum f(n) / N with f(n) = n log n. Smooth: a
/// DRR value counts in four bins by a cubic B-spline window (Thevenaz and Unser, IEEE TIP 9(12),
/// 2000; Mattes et al., IEEE TMI 22(1), 2003). Its range is mapped to the bins that have a
/// neighbour on one side and two on the other. Every score is then differentiable.
class JointHistogramMeasure : public DifferentiableMeasure {
 public:
  [[nodiscard]] double evaluate(std::span<const float> drr,
                                SimilarityWorkspace& workspace) const override;
  double evaluate_with_derivative(std::span<const float> drr,
                                  std::span<float> derivative,
                                  SimilarityWorkspace& workspace) const override;
  [[nodiscard]] std::unique_ptr<SimilarityWorkspace> make_workspace() const override;

 protected:
  /// Throws InputError when the reference has problems.
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
  double xray_entropy_ = 0.0;  ///< no pose changes it
};

/// Mutual information, in nats, of X-ray and DRR from their joint histogram (Maes et al., IEEE TMI
/// 16(2), 1997; eq. (13) sums it over views):
///
///     MI = H(x) + H(d) - H(x, d) = sum_ij p_ij log(p_ij / (p_i q_j))
///
/// \test MutualInformation.OfAnImageWithItselfIsItsEntropy
class MutualInformation final : public JointHistogramMeasure {
 public:
  /// Throws InputError when the reference has problems. `is_smooth`: see JointHistogramMeasure.
  MutualInformation(const SimilarityReference& reference, int bins, bool is_smooth = false)
      : JointHistogramMeasure(reference, bins, is_smooth) {}

 protected:
  [[nodiscard]] EntropyScore score(const JointEntropies& entropies) const override {
    return {entropies.xray + entropies.drr - entropies.joint, 1.0, -1.0};
  }
};

/// Normalised mutual information (Studholme et al., Pattern Recognition 32(1), 1999),
///
///     NMI = (H(x) + H(d)) / H(x, d)   in [1, 2],
///
/// 1 when the images are independent (and when both are constant), 2 when each is a function of the
/// other. It rewards the mere overlap of varied regions less than MI does.
/// \test NormalizedMutualInformation.IsTwoForAnImageWithItself
class NormalizedMutualInformation final : public JointHistogramMeasure {
 public:
  /// Throws InputError when the reference has problems. `is_smooth`: see JointHistogramMeasure.
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
