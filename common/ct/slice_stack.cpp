// SPDX-License-Identifier: Apache-2.0
#include "ct/slice_stack.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"

namespace af {

namespace {

constexpr std::int16_t kBesideSlicesHu = -1000;
constexpr double kMostMore = 1e6;  ///< pixels; callers refuse a grid this wide
/// Rounding of positions, in pixels.
constexpr double kTolerance = 1e-6;

struct Place {
  std::size_t slice = 0;  ///< the lower of two slices
  double share = 0.0;     ///< share of the upper slice
};

/// The slices around a height. Heights ascend.
Place place_of(const std::vector<double>& heights, double height) {
  const auto upper = std::upper_bound(heights.begin(), heights.end(), height);
  const auto last = static_cast<std::ptrdiff_t>(heights.size()) - 2;
  const std::ptrdiff_t lower = std::clamp<std::ptrdiff_t>(upper - heights.begin() - 1, 0, last);
  const auto at = static_cast<std::size_t>(lower);
  const double share = (height - heights[at]) / (heights[at + 1] - heights[at]);
  return {at, std::clamp(share, 0.0, 1.0)};
}

/// One axis of a bilinear sample: the lower pixel and the share of the upper one.
struct Sample {
  int lower = -1;  ///< -1: beside the slice
  double share = 0.0;
};

Sample sample_at(double index, int count) {
  if (index < -kTolerance || index > count - 1 + kTolerance) return {};
  const int lower = std::clamp(static_cast<int>(std::floor(index)), 0, std::max(0, count - 2));
  return {lower, std::clamp(index - lower, 0.0, 1.0)};
}

double bilinear(const std::int16_t* slice, int columns, const Sample& x, const Sample& y) {
  const std::int16_t* const corner =
      slice + static_cast<std::ptrdiff_t>(y.lower) * columns + x.lower;
  const double top = (1.0 - x.share) * corner[0] + x.share * corner[1];
  const double bottom = (1.0 - x.share) * corner[columns] + x.share * corner[columns + 1];
  return (1.0 - y.share) * top + y.share * bottom;
}

std::vector<double> coordinates(const SliceStack& stack, Eigen::Index axis) {
  std::vector<double> values;
  values.reserve(stack.origins_mm.size());
  for (const Eigen::Vector3d& origin : stack.origins_mm)
    values.push_back(stack.axes.col(axis).dot(origin));
  return values;
}

}  // namespace

CtGrid upright_grid(const SliceStack& stack) {
  check(stack.origins_mm.size() >= 2 && stack.columns >= 2 && stack.rows >= 2,
        "a stack has two slices of 2 x 2 pixels at least");
  const std::vector<double> heights = coordinates(stack, 2);
  std::vector<double> gaps;
  for (std::size_t i = 1; i < heights.size(); ++i) gaps.push_back(heights[i] - heights[i - 1]);
  std::sort(gaps.begin(), gaps.end());
  const double length = heights.back() - heights.front();
  const double intervals = std::max(1.0, std::round(length / gaps[gaps.size() / 2]));
  CtGrid grid;
  grid.direction = stack.axes;
  grid.spacing_mm << stack.spacing_mm.x(), stack.spacing_mm.y(), length / intervals;
  grid.size[2] = static_cast<int>(intervals) + 1;
  Eigen::Vector3d low;
  low.z() = heights.front();
  for (const Eigen::Index axis : {0, 1}) {
    const std::vector<double> shifts = coordinates(stack, axis);
    const auto [least, most] = std::minmax_element(shifts.begin(), shifts.end());
    low[axis] = *least;
    const double more = std::ceil((*most - *least) / stack.spacing_mm[axis] - kTolerance);
    grid.size[static_cast<std::size_t>(axis)] = (axis == 0 ? stack.columns : stack.rows) +
                                                static_cast<int>(std::clamp(more, 0.0, kMostMore));
  }
  grid.origin_mm = stack.axes * low;
  return grid;
}

std::vector<std::int16_t> resampled(const SliceStack& stack,
                                    std::span<const std::int16_t> hu,
                                    const CtGrid& grid) {
  const std::size_t slice_size =
      static_cast<std::size_t>(stack.columns) * static_cast<std::size_t>(stack.rows);
  check(hu.size() == slice_size * stack.origins_mm.size(), "a stack has a value per pixel");
  const std::vector<double> heights = coordinates(stack, 2);
  const std::vector<double> across = coordinates(stack, 0);
  const std::vector<double> down = coordinates(stack, 1);
  const Eigen::Vector3d low = stack.axes.transpose() * grid.origin_mm;
  std::vector<std::int16_t> values(grid.voxel_count(), kBesideSlicesHu);
  std::size_t at = 0;
  for (int k = 0; k < grid.size[2]; ++k) {
    const Place place = place_of(heights, low.z() + k * grid.spacing_mm.z());
    const auto between = [&](const std::vector<double>& shifts) {
      return (1.0 - place.share) * shifts[place.slice] + place.share * shifts[place.slice + 1];
    };
    const double column_shift = (low.x() - between(across)) / stack.spacing_mm.x();
    const double row_shift = (low.y() - between(down)) / stack.spacing_mm.y();
    const std::int16_t* const lower = hu.data() + place.slice * slice_size;
    for (int j = 0; j < grid.size[1]; ++j) {
      const Sample y = sample_at(j + row_shift, stack.rows);
      for (int i = 0; i < grid.size[0]; ++i, ++at) {
        const Sample x = sample_at(i + column_shift, stack.columns);
        if (x.lower < 0 || y.lower < 0) continue;
        const double value = (1.0 - place.share) * bilinear(lower, stack.columns, x, y) +
                             place.share * bilinear(lower + slice_size, stack.columns, x, y);
        values[at] = static_cast<std::int16_t>(std::nearbyint(value));
      }
    }
  }
  return values;
}

}  // namespace af
