// SPDX-License-Identifier: Apache-2.0
#include "register/similarity/mutual_information.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"

namespace af::registration {
namespace {

/// Neighbouring pixels tend to fall into the same cell; counting them in turn into two histograms
/// keeps an increment from waiting for the one before it.
constexpr std::size_t kInterleaved = 2;

class MutualInformationWorkspace final : public SimilarityWorkspace {
 public:
  explicit MutualInformationWorkspace(std::size_t cells) : joint(cells) {}
  std::vector<std::uint32_t> joint;
};

std::vector<double> n_log_n_table(std::size_t largest) {
  std::vector<double> table(largest + 1, 0.0);
  for (std::size_t n = 2; n <= largest; ++n)
    table[n] = static_cast<double>(n) * std::log(static_cast<double>(n));
  return table;
}

ValueRange used_range(const SimilarityReference& reference) {
  ValueRange range{0.0, 0.0};
  bool first = true;
  for (std::size_t i = 0; i < reference.xray.pixels.size(); ++i) {
    if (!reference.is_used(i)) continue;
    const auto value = static_cast<double>(reference.xray.pixels[i]);
    range.low = first ? value : std::min(range.low, value);
    range.high = first ? value : std::max(range.high, value);
    first = false;
  }
  return range;
}

}  // namespace

MutualInformation::MutualInformation(const SimilarityReference& reference, int bins)
    : bins_(bins),
      drr_low_(static_cast<float>(reference.drr_range.low)),
      drr_scale_(static_cast<float>(bins / (reference.drr_range.high - reference.drr_range.low))) {
  check(bins >= 2 && bins <= kMaxHistogramBins, "histogram bins out of range");
  throw_if_any(problems(reference));
  const ValueRange range = used_range(reference);
  const std::size_t pixels = reference.xray.pixels.size();
  const auto rows = static_cast<std::size_t>(bins);
  std::vector<std::uint32_t> row_counts(rows, 0);
  xray_rows_.resize(pixels);
  std::size_t used = 0;
  for (std::size_t i = 0; i < pixels; ++i) {
    const double position = (static_cast<double>(reference.xray.pixels[i]) - range.low) /
                            (range.high - range.low) * bins;
    // An unused pixel may hold anything, NaN too: its value is not looked at.
    const std::size_t row =
        reference.is_used(i)
            ? static_cast<std::size_t>(std::clamp(static_cast<int>(position), 0, bins - 1))
            : rows;
    xray_rows_[i] = static_cast<std::uint32_t>(row * rows);
    if (row == rows) continue;
    ++row_counts[row];
    ++used;
  }
  n_log_n_ = n_log_n_table(used);
  used_pixels_ = static_cast<double>(used);
  for (const std::uint32_t count : row_counts) xray_sum_ += n_log_n_[count];
}

void MutualInformation::count(std::span<const float> drr, std::span<std::uint32_t> joint) const {
  const std::size_t cells = joint.size() / kInterleaved;
  std::fill(joint.begin(), joint.end(), 0U);
  const auto last_bin = static_cast<float>(bins_ - 1);
  const auto column_of = [&](float value) {
    // In this order of arguments a NaN becomes bin 0 instead of an undefined conversion.
    const float position = std::min(std::max(0.0f, (value - drr_low_) * drr_scale_), last_bin);
    return static_cast<std::uint32_t>(static_cast<std::int32_t>(position));
  };
  std::uint32_t* const even = joint.data();
  std::uint32_t* const odd = joint.data() + cells;
  std::size_t i = 0;
  for (; i + kInterleaved <= drr.size(); i += kInterleaved) {
    ++even[xray_rows_[i] + column_of(drr[i])];
    ++odd[xray_rows_[i + 1] + column_of(drr[i + 1])];
  }
  for (; i < drr.size(); ++i) ++even[xray_rows_[i] + column_of(drr[i])];
}

double MutualInformation::from_counts(std::span<const std::uint32_t> joint) const {
  const auto bins = static_cast<std::size_t>(bins_);
  const std::size_t cells = joint.size() / kInterleaved;
  std::uint32_t column_counts[kMaxHistogramBins] = {};
  double joint_sum = 0.0;
  for (std::size_t row = 0; row < bins; ++row) {  // without the row of unused pixels
    for (std::size_t column = 0; column < bins; ++column) {
      const std::size_t cell = row * bins + column;
      const std::uint32_t count = joint[cell] + joint[cells + cell];
      if (count == 0) continue;
      column_counts[column] += count;
      joint_sum += n_log_n_[count];
    }
  }
  double drr_sum = 0.0;
  for (std::size_t column = 0; column < bins; ++column) drr_sum += n_log_n_[column_counts[column]];
  return std::log(used_pixels_) + (joint_sum - xray_sum_ - drr_sum) / used_pixels_;
}

double MutualInformation::evaluate(std::span<const float> drr,
                                   SimilarityWorkspace& workspace) const {
  check(drr.size() == xray_rows_.size(), "the DRR must have the size of its reference");
  auto& mine = dynamic_cast<MutualInformationWorkspace&>(workspace);
  count(drr, mine.joint);
  return from_counts(mine.joint);
}

std::unique_ptr<SimilarityWorkspace> MutualInformation::make_workspace() const {
  const auto bins = static_cast<std::size_t>(bins_);
  return std::make_unique<MutualInformationWorkspace>(kInterleaved * (bins + 1) * bins);
}

}  // namespace af::registration
