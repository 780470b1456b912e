// SPDX-License-Identifier: Apache-2.0
#include "drr/slab_sum.h"

#include <algorithm>
#include <cmath>

#include "base/vector_width.h"

namespace af {

namespace {

/// Values that kernels load beyond the last column.
constexpr std::size_t kBeyond = 48;

/// Linear between, or beyond, the two nodes around a coordinate.
SumRow linear_taps(double coordinate, int nodes) {
  const int lower = std::clamp(static_cast<int>(std::floor(coordinate)), 0, nodes - 2);
  SumRow taps{};
  taps.first = std::clamp(lower, 0, std::max(0, nodes - kSumTaps));
  const auto at = static_cast<std::size_t>(lower - taps.first);
  const auto x = static_cast<float>(coordinate - lower);
  taps.weights[at] = 1.0f - x;
  taps.weights[at + 1] = x;
  taps.slopes[at] = -1.0f;
  taps.slopes[at + 1] = 1.0f;
  return taps;
}

/// Lagrange's polynomial through the four nodes around a coordinate.
SumRow cubic_taps(double coordinate, int nodes) {
  SumRow taps{};
  taps.first = std::clamp(static_cast<int>(coordinate) - 1, 0, nodes - kSumTaps);
  const double x = coordinate - taps.first;
  const double a = x - 1.0;
  const double b = x - 2.0;
  const double c = x - 3.0;
  const std::array<double, 4> weights{
      -a * b * c / 6.0, x * b * c / 2.0, -x * a * c / 2.0, x * a * b / 6.0};
  const std::array<double, 4> slopes{-(a * b + a * c + b * c) / 6.0,
                                     (x * b + x * c + b * c) / 2.0,
                                     -(x * a + x * c + a * c) / 2.0,
                                     (x * a + x * b + a * b) / 6.0};
  for (std::size_t i = 0; i < weights.size(); ++i) {
    taps.weights[i] = static_cast<float>(weights[i]);
    taps.slopes[i] = static_cast<float>(slopes[i]);
  }
  return taps;
}

/// Beyond the image it goes on linearly for a node: the outermost cells of a sum have corners
/// there.
SumRow taps_at(double coordinate, int nodes) {
  const double limited = std::clamp(coordinate, -1.0, static_cast<double>(nodes));
  if (nodes < kSumTaps || limited < 0.0 || limited > nodes - 1.0)
    return linear_taps(limited, nodes);
  return cubic_taps(limited, nodes);
}

}  // namespace

void SlabSum::make_columns(const NodeGrid& slab, double reach_ratio, SumColumns& columns) {
  const auto count = static_cast<std::size_t>(grid_.s_count);
  const std::size_t padded = count + kBeyond;
  scratch_.columns.resize(padded);
  scratch_.column_weights.resize(std::size_t{2} * kSumTaps * padded);
  columns.first = scratch_.columns.data();
  for (std::size_t tap = 0; tap < kSumTaps; ++tap) {
    columns.weights[tap] = scratch_.column_weights.data() + tap * padded;
    columns.slopes[tap] = scratch_.column_weights.data() + (kSumTaps + tap) * padded;
  }
  for (std::size_t i = 0; i < padded; ++i) {
    const double sum_mm =
        grid_.s_first_mm + grid_.s_spacing_mm * static_cast<double>(std::min(i, count - 1));
    const double slab_mm = source_.x() + reach_ratio * (sum_mm - source_.x());
    const SumRow taps = taps_at((slab_mm - slab.s_first_mm) / slab.s_spacing_mm, slab.s_count);
    scratch_.columns[i] = taps.first;
    for (std::size_t tap = 0; tap < kSumTaps; ++tap) {
      scratch_.column_weights[tap * padded + i] = taps.weights[tap];
      scratch_.column_weights[(kSumTaps + tap) * padded + i] = taps.slopes[tap];
    }
  }
}

void SlabSum::make_rows(const NodeGrid& slab, double reach_ratio) {
  scratch_.rows.clear();
  for (int i = 0; i < grid_.t_count; ++i) {
    const double sum_mm = grid_.t_first_mm + grid_.t_spacing_mm * i;
    const double slab_mm = source_.z() + reach_ratio * (sum_mm - source_.z());
    scratch_.rows.push_back(taps_at((slab_mm - slab.t_first_mm) / slab.t_spacing_mm, slab.t_count));
  }
}

void SlabSum::add(const NodeImages& slab) {
  const auto add_slab =
      select_kernel<AddSlab>(kernels_128::add_slab, kernels_256::add_slab, kernels_512::add_slab);
  const double reach_ratio =
      (slab.grid.plane_y_mm - source_.y()) / (grid_.plane_y_mm - source_.y());
  SlabTerm term{};
  term.stride = slab.grid.stride;
  term.columns = slab.grid.s_count;
  make_columns(slab.grid, reach_ratio, term.s);
  make_rows(slab.grid, reach_ratio);
  term.t = scratch_.rows.data();
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
