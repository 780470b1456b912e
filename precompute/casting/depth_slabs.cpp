// SPDX-License-Identifier: Apache-2.0
#include "precompute/casting/depth_slabs.h"

#include <algorithm>
#include <limits>
#include <string>

#include "base/error.h"

namespace af {

namespace {

/// Sums of weights, first and second moments of slices [0, i). They give any run's moments in one
/// step.
class RunMoments {
 public:
  explicit RunMoments(std::span<const std::int64_t> slice_sums) {
    double total = 0.0;
    for (const std::int64_t sum : slice_sums)
      total += static_cast<double>(std::max<std::int64_t>(0, sum));
    double y = 0.0;
    for (const std::int64_t sum : slice_sums) {
      // Sharpened slices may sum to less than 0 just outside the volume.
      const double weight = static_cast<double>(std::max<std::int64_t>(0, sum)) / total;
      weights_.push_back(weights_.back() + weight);
      first_.push_back(first_.back() + weight * y);
      second_.push_back(second_.back() + weight * y * y);
      y += 1.0;
    }
  }

  [[nodiscard]] double weight(std::size_t begin, std::size_t end) const {
    return weights_[end] - weights_[begin];
  }
  [[nodiscard]] double centroid(std::size_t begin, std::size_t end) const {
    return (first_[end] - first_[begin]) / weight(begin, end);
  }
  /// Weighted squared distance from the centroid. Infinite for a run that attenuates nothing.
  [[nodiscard]] double cost(std::size_t begin, std::size_t end) const {
    if (!(weight(begin, end) > 0.0)) return std::numeric_limits<double>::infinity();
    const double moment = first_[end] - first_[begin];
    return second_[end] - second_[begin] - moment * moment / weight(begin, end);
  }

 private:
  std::vector<double> weights_{0.0};
  std::vector<double> first_{0.0};
  std::vector<double> second_{0.0};
};

}  // namespace

std::vector<int> best_slice_cuts(std::span<const std::int64_t> slice_sums, int slabs) {
  const auto attenuating =
      std::count_if(slice_sums.begin(), slice_sums.end(), [](std::int64_t sum) { return sum > 0; });
  if (slabs < 1 || slabs > attenuating)
    throw InputError("slabs",
                     std::to_string(slabs),
                     "must be at least 1 and at most " + std::to_string(attenuating) +
                         ", the CT's attenuating slices along the view");
  const RunMoments moments(slice_sums);
  const std::size_t slices = slice_sums.size();
  const auto slab_count = static_cast<std::size_t>(slabs);
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  // best[i]: least cost of slices [0, i) in k slabs. last_cut[k][i]: where its last slab begins.
  std::vector<double> best(slices + 1, kInfinity);
  best[0] = 0.0;
  std::vector<std::vector<std::size_t>> last_cut(slab_count + 1,
                                                 std::vector<std::size_t>(slices + 1, 0));
  for (std::size_t k = 1; k <= slab_count; ++k) {
    std::vector<double> next(slices + 1, kInfinity);
    for (std::size_t end = 1; end <= slices; ++end)
      for (std::size_t begin = 0; begin < end; ++begin) {
        const double cost = best[begin] + moments.cost(begin, end);
        if (!(cost < next[end])) continue;
        next[end] = cost;
        last_cut[k][end] = begin;
      }
    best = std::move(next);
  }
  std::vector<int> cuts(slab_count - 1);
  std::size_t end = slices;
  for (std::size_t k = slab_count; k > 1; --k) {
    end = last_cut[k][end];
    cuts[k - 2] = static_cast<int>(end);
  }
  return cuts;
}

DepthSlabs choose_depth_slabs(const SlabAlignedVolume& volume, int slabs, StPlane st_plane) {
  return choose_depth_slabs(volume.grid(), volume.slice_sums(), slabs, st_plane);
}

DepthSlabs choose_depth_slabs(const SlabAlignedGrid& grid,
                              std::span<const std::int64_t> sums,
                              int slabs,
                              StPlane st_plane) {
  const std::vector<int> cuts = best_slice_cuts(sums, slabs);
  const RunMoments moments(sums);
  DepthSlabs depth_slabs;
  std::size_t begin = 0;
  for (std::size_t k = 0; k <= cuts.size(); ++k) {
    const std::size_t end = k < cuts.size() ? static_cast<std::size_t>(cuts[k]) : sums.size();
    if (k < cuts.size())
      depth_slabs.boundaries_y_mm.push_back(grid.slice_y_mm(cuts[k]) - grid.spacing_mm.y() / 2.0);
    depth_slabs.st_plane_y_mm.push_back(
        st_plane == StPlane::Centre
            ? 0.0
            : grid.origin_mm.y() + grid.spacing_mm.y() * moments.centroid(begin, end));
    begin = end;
  }
  return depth_slabs;
}

}  // namespace af
