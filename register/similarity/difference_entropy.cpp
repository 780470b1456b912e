// SPDX-License-Identifier: Apache-2.0
#include "register/similarity/difference_entropy.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace af::registration {

DifferenceEntropy::DifferenceEntropy(const SimilarityReference& reference, int bins)
    : difference_(reference), bins_(bins) {}

double DifferenceEntropy::evaluate(std::span<const float> drr,
                                   SimilarityWorkspace& workspace) const {
  auto& mine = dynamic_cast<DifferenceWorkspace&>(workspace);
  if (!difference_.take(drr, mine)) return std::numeric_limits<double>::quiet_NaN();
  std::fill(mine.counts.begin(), mine.counts.end(), 0U);
  const auto bins_per_unit = static_cast<float>(bins_ / (2.0 * difference_.xray_range()));
  // Zero difference is the middle of a bin, so that rounding does not spread it over two.
  const int middle_bin = bins_ / 2;
  const float middle = static_cast<float>(middle_bin) + 0.5f;
  const auto last = static_cast<float>(bins_ - 1);
  for (std::size_t i = 0; i < drr.size(); ++i) {
    if (difference_.weights()[i] == 0.0f) continue;
    const float position = std::clamp(mine.difference[i] * bins_per_unit + middle, 0.0f, last);
    ++mine.counts[static_cast<std::size_t>(position)];
  }
  double sum = 0.0;
  for (const std::uint32_t count : mine.counts) {
    if (count == 0) continue;
    const double p = count / difference_.used_pixels();
    sum += p * std::log(p);
  }
  return sum;
}

std::unique_ptr<SimilarityWorkspace> DifferenceEntropy::make_workspace() const {
  auto workspace = std::make_unique<DifferenceWorkspace>();
  workspace->difference.resize(difference_.weights().size());
  workspace->counts.resize(static_cast<std::size_t>(bins_));
  return workspace;
}

}  // namespace af::registration
