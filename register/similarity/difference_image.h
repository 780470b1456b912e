// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "register/similarity/similarity_measure.h"

namespace af::registration {

/// Scratch memory of the measures that work on a difference image.
class DifferenceWorkspace final : public SimilarityWorkspace {
 public:
  std::vector<float> difference;
  std::vector<std::uint32_t> counts;
};

/// x - a d - b over the used pixels, with gain a >= 0 and offset b from least squares (Penney et
/// al., IEEE TMI 17(4), 1998, search for the gain).
class DifferenceImage {
 public:
  /// Throws InputError when the reference has problems.
  explicit DifferenceImage(const SimilarityReference& reference);

  /// Fills workspace.difference, with 0 for unused pixels. False when the DRR is not finite.
  bool take(std::span<const float> drr, DifferenceWorkspace& workspace) const;

  [[nodiscard]] const std::vector<float>& weights() const { return weights_; }
  [[nodiscard]] double used_pixels() const { return used_pixels_; }
  [[nodiscard]] double xray_range() const { return xray_range_; }

 private:
  std::vector<float> centered_xray_;  ///< 0 where unused
  std::vector<float> weights_;
  double used_pixels_ = 0.0;
  double xray_range_ = 0.0;
  double drr_offset_ = 0.0;
};

}  // namespace af::registration
