// SPDX-License-Identifier: Apache-2.0
#include "register/similarity/mutual_information.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/error.h"
#include "register/similarity/pixel_sums.h"

namespace af::registration {
namespace {

constexpr std::size_t kCopies = kHistogramCopies;

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

/// Weights of a cubic B-spline at four bins, for a value `t` in [0, 1) past the second of them.
std::array<float, 4> cubic_window(float t) {
  const float u = 1.0f - t;
  const float sixth = 1.0f / 6.0f;
  return {sixth * u * u * u,
          sixth * (4.0f - 3.0f * t * t * (2.0f - t)),
          sixth * (4.0f - 3.0f * u * u * (2.0f - u)),
          sixth * t * t * t};
}

/// The derivatives of these weights with respect to t.
std::array<float, 4> cubic_window_slopes(float t) {
  const float u = 1.0f - t;
  return {-0.5f * u * u, t * (1.5f * t - 2.0f), -u * (1.5f * u - 2.0f), 0.5f * t * t};
}

/// Where a DRR value falls among the windows: the bin before it, and how far beyond that bin.
struct WindowPosition {
  std::uint32_t first_bin = 0;  ///< of four
  float t = 0.0f;
  bool is_inside = true;  ///< false: clamped to the range's end, where the derivative is 0
};

WindowPosition window_position(float value, float low, float bins_per_unit, int bins) {
  const auto end = static_cast<float>(bins - 3);
  const float free = (value - low) * bins_per_unit;
  // This order of arguments turns a NaN into 0, whose conversion would otherwise be undefined.
  const float position = std::min(std::max(0.0f, free), end);
  const auto bin = std::min(static_cast<std::int32_t>(position), bins - 4);
  return {static_cast<std::uint32_t>(bin),
          position - static_cast<float>(bin),
          free > 0.0f && free < end};
}

/// -sum p log p, and -log p in place of p (0 where p is 0).
double take_entropy(std::span<float> probabilities) {
  double entropy = 0.0;
  for (float& p : probabilities) {
    const double minus_log = p > 0.0f ? -std::log(static_cast<double>(p)) : 0.0;
    entropy += static_cast<double>(p) * minus_log;
    p = static_cast<float>(minus_log);
  }
  return entropy;
}

}  // namespace

class JointHistogramMeasure::Workspace final : public SimilarityWorkspace {
 public:
  std::vector<std::uint32_t> counts;  ///< plain: kCopies histograms
  std::vector<float> joint;           ///< smooth: two histograms; then -log p_ij in the first
  std::vector<float> drr;             ///< smooth: -log q_j
};

JointHistogramMeasure::JointHistogramMeasure(const SimilarityReference& reference,
                                             int bins,
                                             bool is_smooth)
    : bins_(bins), is_smooth_(is_smooth) {
  check(bins >= (is_smooth ? 4 : 2) && bins <= kMaxHistogramBins, "histogram bins out of range");
  throw_if_any(problems(reference));
  const double drr_span = reference.drr_range.high - reference.drr_range.low;
  drr_low_ = static_cast<float>(reference.drr_range.low);
  bins_per_unit_ = static_cast<float>((is_smooth ? bins - 3 : bins) / drr_span);
  const ValueRange range = used_range(reference);
  const std::size_t pixels = reference.xray.pixels.size();
  const auto rows = static_cast<std::size_t>(bins);
  std::vector<std::uint32_t> row_counts(rows, 0);
  xray_rows_.resize(pixels);
  std::size_t used = 0;
  for (std::size_t i = 0; i < pixels; ++i) {
    const double position = (static_cast<double>(reference.xray.pixels[i]) - range.low) /
                            (range.high - range.low) * bins;
    // An unused pixel may hold anything, including NaN, so its value is not looked at.
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
  double sum = 0.0;
  for (const std::uint32_t count : row_counts) sum += n_log_n_[count];
  xray_entropy_ = std::log(used_pixels_) - sum / used_pixels_;
}

JointEntropies JointHistogramMeasure::plain_entropies(std::span<const float> drr,
                                                      Workspace& mine) const {
  const auto bins = static_cast<std::size_t>(bins_);
  const std::size_t cells = mine.counts.size() / kCopies;
  std::fill(mine.counts.begin(), mine.counts.end(), 0U);
  pixel_sum_kernels().count_histogram({drr.data(),
                                       xray_rows_.data(),
                                       drr_low_,
                                       bins_per_unit_,
                                       static_cast<float>(bins_ - 1),
                                       mine.counts.data(),
                                       static_cast<std::int32_t>(cells)},
                                      static_cast<std::int32_t>(drr.size()));
  std::uint32_t column_counts[kMaxHistogramBins] = {};
  double joint_sum = 0.0;
  const std::uint32_t* const counts = mine.counts.data();
  for (std::size_t row = 0; row < bins; ++row) {  // without the row of unused pixels
    double row_sum = 0.0;
    for (std::size_t column = 0; column < bins; ++column) {
      const std::size_t cell = row * bins + column;
      const std::uint32_t count = (counts[cell] + counts[cells + cell]) +
                                  (counts[2 * cells + cell] + counts[3 * cells + cell]);
      column_counts[column] += count;
      row_sum += n_log_n_[count];
    }
    joint_sum += row_sum;
  }
  double drr_sum = 0.0;
  for (std::size_t column = 0; column < bins; ++column) drr_sum += n_log_n_[column_counts[column]];
  const double log_n = std::log(used_pixels_);
  return {xray_entropy_, log_n - drr_sum / used_pixels_, log_n - joint_sum / used_pixels_};
}

void JointHistogramMeasure::count_smoothly(std::span<const float> drr, Workspace& mine) const {
  const auto bins = static_cast<std::size_t>(bins_);
  const std::size_t cells = mine.joint.size() / 2;
  std::fill(mine.joint.begin(), mine.joint.end(), 0.0f);
  for (std::size_t i = 0; i < drr.size(); ++i) {
    const WindowPosition at = window_position(drr[i], drr_low_, bins_per_unit_, bins_);
    const std::array<float, 4> window = cubic_window(at.t);
    // Two histograms are used in turn, so that an addition need not wait for the neighbouring
    // pixel's.
    float* const cell = mine.joint.data() + (i % 2) * cells + xray_rows_[i] + at.first_bin;
    for (std::size_t k = 0; k < 4; ++k) cell[k] += window[k];
  }
  const auto share = static_cast<float>(1.0 / used_pixels_);
  std::fill(mine.drr.begin(), mine.drr.end(), 0.0f);
  for (std::size_t row = 0; row < bins; ++row)
    for (std::size_t column = 0; column < bins; ++column) {
      const std::size_t cell = row * bins + column;
      mine.joint[cell] = share * (mine.joint[cell] + mine.joint[cells + cell]);
      mine.drr[column] += mine.joint[cell];
    }
}

JointEntropies JointHistogramMeasure::smooth_entropies(std::span<const float> drr,
                                                       Workspace& mine) const {
  count_smoothly(drr, mine);
  const auto bins = static_cast<std::size_t>(bins_);
  const double joint = take_entropy(std::span(mine.joint).first(bins * bins));
  return {xray_entropy_, take_entropy(mine.drr), joint};
}

double JointHistogramMeasure::evaluate(std::span<const float> drr,
                                       SimilarityWorkspace& workspace) const {
  check(drr.size() == xray_rows_.size(), "the DRR must have the size of its reference");
  auto& mine = dynamic_cast<Workspace&>(workspace);
  return score(is_smooth_ ? smooth_entropies(drr, mine) : plain_entropies(drr, mine)).value;
}

double JointHistogramMeasure::evaluate_with_derivative(std::span<const float> drr,
                                                       std::span<float> derivative,
                                                       SimilarityWorkspace& workspace) const {
  check(is_smooth_, "only smooth histograms have derivatives");
  check(drr.size() == xray_rows_.size() && derivative.size() == drr.size(),
        "DRR and derivative must have the size of the reference");
  auto& mine = dynamic_cast<Workspace&>(workspace);
  const EntropyScore score = this->score(smooth_entropies(drr, mine));
  // dH/dd = sum_k -log p_k dp_k/dd. The windows' slopes add up to 0, so the "- 1" drops out.
  const auto scale = static_cast<double>(bins_per_unit_) / used_pixels_;
  const auto by_joint = static_cast<float>(score.by_joint * scale);
  const auto by_drr = static_cast<float>(score.by_drr * scale);
  const std::uint32_t unused_row =
      static_cast<std::uint32_t>(bins_) * static_cast<std::uint32_t>(bins_);
  for (std::size_t i = 0; i < drr.size(); ++i) {
    const WindowPosition at = window_position(drr[i], drr_low_, bins_per_unit_, bins_);
    derivative[i] = 0.0f;
    if (!at.is_inside || xray_rows_[i] == unused_row) continue;
    const std::array<float, 4> slopes = cubic_window_slopes(at.t);
    const float* const joint = mine.joint.data() + xray_rows_[i] + at.first_bin;
    const float* const marginal = mine.drr.data() + at.first_bin;
    float sum = 0.0f;
    for (std::size_t k = 0; k < 4; ++k)
      sum += slopes[k] * (by_joint * joint[k] + by_drr * marginal[k]);
    derivative[i] = sum;
  }
  return score.value;
}

std::unique_ptr<SimilarityWorkspace> JointHistogramMeasure::make_workspace() const {
  const auto bins = static_cast<std::size_t>(bins_);
  const std::size_t cells = (bins + 1) * bins;
  auto workspace = std::make_unique<Workspace>();
  if (is_smooth_) {
    workspace->joint.resize(2 * cells);
    workspace->drr.resize(bins);
  } else {
    workspace->counts.resize(kCopies * cells);
  }
  return workspace;
}

}  // namespace af::registration
