// SPDX-License-Identifier: Apache-2.0
#include "drr/slab_sum.h"

#include <algorithm>
#include <cmath>

#include "base/vector_width.h"

namespace af {

namespace {

/// Entries that kernels load beyond the last column.
constexpr std::size_t kBeyond = 48;

/// Linear taps between the two nodes around a coordinate, or beyond them.
void place_linear_taps(double coordinate, int nodes, std::size_t i, const SumTaps& taps) {
  // This order turns NaN into -1.
  const double limited = std::min(std::max(-1.0, coordinate), static_cast<double>(nodes));
  const int lower = std::clamp(static_cast<int>(std::floor(limited)), 0, nodes - 2);
  taps.first[i] = std::clamp(lower, 0, std::max(0, nodes - kSumTaps));
  for (std::size_t tap = 0; tap < kSumTaps; ++tap)
    taps.weights[tap][i] = taps.slopes[tap][i] = 0.0f;
  const auto at = static_cast<std::size_t>(lower - taps.first[i]);
  const auto x = static_cast<float>(limited - lower);
  taps.weights[at][i] = 1.0f - x;
  taps.weights[at + 1][i] = x;
  taps.slopes[at][i] = -1.0f;
  taps.slopes[at + 1][i] = 1.0f;
}

/// The nodes of a sum along one axis, in the coordinates of a slab's image.
struct NodesInSlab {
  double start, step;
  int count;
  int slab_nodes;
};

/// Taps continue linearly for one node beyond the image, because the outermost cells of a sum have
/// corners there.
void place_all_taps(const NodesInSlab& nodes, const SumTaps& taps) {
  const auto place_linear = [&](int i) {
    place_linear_taps(
        nodes.start + nodes.step * i, nodes.slab_nodes, static_cast<std::size_t>(i), taps);
  };
  // Kernels load entries beyond the last one.
  const int padded = nodes.count + static_cast<int>(kBeyond) / 2;
  if (nodes.slab_nodes < kSumTaps) {
    for (int i = 0; i < padded; ++i) place_linear(i);
    return;
  }
  select_kernel<PlaceTaps>(kernels_128::place_taps,
                           kernels_256::place_taps,
                           kernels_512::place_taps)(static_cast<float>(nodes.start),
                                                    static_cast<float>(nodes.step),
                                                    nodes.slab_nodes,
                                                    padded,
                                                    taps);
  const auto is_beyond = [&](int i) {
    const double at = nodes.start + nodes.step * i;
    return at < 0.0 || at > nodes.slab_nodes - 1.0;
  };
  for (int i = 0; i < nodes.count && is_beyond(i); ++i) place_linear(i);
  for (int i = nodes.count - 1; i >= 0 && is_beyond(i); --i) place_linear(i);
}

/// Memory for the taps of `count` columns or rows.
SumTaps reserve_taps(int count, std::vector<std::int32_t>& first, std::vector<float>& weights) {
  const std::size_t padded = static_cast<std::size_t>(count) + kBeyond;
  first.resize(std::max(first.size(), padded));
  weights.resize(std::max(weights.size(), std::size_t{2} * kSumTaps * padded));
  SumTaps taps{};
  taps.first = first.data();
  for (std::size_t tap = 0; tap < kSumTaps; ++tap) {
    taps.weights[tap] = weights.data() + tap * padded;
    taps.slopes[tap] = weights.data() + (kSumTaps + tap) * padded;
  }
  return taps;
}

}  // namespace

void SlabSum::add(const NodeImages& slab) {
  const auto add_slab =
      select_kernel<AddSlab>(kernels_128::add_slab, kernels_256::add_slab, kernels_512::add_slab);
  const double reach_ratio =
      (slab.grid.plane_y_mm - source_.y()) / (grid_.plane_y_mm - source_.y());
  SlabTerm term{};
  term.stride = slab.grid.stride;
  term.columns = slab.grid.s_count;
  // A node p of the sum is seen at source + reach_ratio (p - source) on the slab's plane.
  term.s = reserve_taps(grid_.s_count, scratch_.first[0], scratch_.weights[0]);
  place_all_taps(
      {(source_.x() + reach_ratio * (grid_.s_first_mm - source_.x()) - slab.grid.s_first_mm) /
           slab.grid.s_spacing_mm,
       reach_ratio * grid_.s_spacing_mm / slab.grid.s_spacing_mm,
       grid_.s_count,
       slab.grid.s_count},
      term.s);
  term.t = reserve_taps(grid_.t_count, scratch_.first[1], scratch_.weights[1]);
  place_all_taps(
      {(source_.z() + reach_ratio * (grid_.t_first_mm - source_.z()) - slab.grid.t_first_mm) /
           slab.grid.t_spacing_mm,
       reach_ratio * grid_.t_spacing_mm / slab.grid.t_spacing_mm,
       grid_.t_count,
       slab.grid.t_count},
      term.t);
  term.drift[0] = static_cast<float>((1.0 - reach_ratio) / slab.grid.s_spacing_mm);
  term.drift[1] = static_cast<float>((1.0 - reach_ratio) / slab.grid.t_spacing_mm);
  for (std::size_t i = 0; i < 3; ++i) {
    auto& row = scratch_.row_images[i];
    row.resize(std::max(row.size(), static_cast<std::size_t>(slab.grid.s_count) + kBeyond));
    term.images[i] = images_[i] == nullptr ? nullptr : slab.images[i];
    term.rows[i] = row.data();
    term.sum[i] = images_[i];
  }
  term.sum_stride = grid_.stride;
  term.sum_columns = grid_.s_count;
  term.sum_rows = grid_.t_count;
  term.adds = !is_empty_;
  add_slab(term);
  is_empty_ = false;
}

}  // namespace af
