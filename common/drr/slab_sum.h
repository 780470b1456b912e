// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <vector>

#include <Eigen/Core>

#include "drr/node_images.h"
#include "drr/slab_sum_kernel.h"

namespace af {

/// Scratch memory of a sum.
struct SlabSumScratch {
  /// For the sum's columns and rows.
  std::array<std::vector<std::int32_t>, 2> first;
  std::array<std::vector<float>, 2> weights;
  std::array<std::vector<float>, 3> row_images;
};

/// Sums images of several slabs on one plane. From one source, the nodes of the sum are scaled and
/// shifted against those of each slab, along s and t separately. A slab is therefore resampled by
/// two passes of four taps (Lagrange's cubic), far cheaper than resampling each slab to the
/// detector. Parallax between slabs is kept, because the sum is made for this source alone.
/// \test SlabSum.OfOneSlabInItsOwnPlaneIsTheSlab
class SlabSum {
 public:
  /// Sums into `images` of grid.t_count rows, each writable for 16 values beyond its end. Null
  /// slopes are not wanted. `source` is in the slab frame.
  SlabSum(const NodeGrid& grid,
          const Eigen::Vector3d& source,
          const std::array<float*, 3>& images,
          SlabSumScratch& scratch)
      : grid_(grid), source_(source), images_(images), scratch_(scratch) {}

  /// Extrapolates linearly by one node beyond the slab's image.
  void add(const NodeImages& slab);
  [[nodiscard]] NodeImages images() const { return {grid_, {images_[0], images_[1], images_[2]}}; }

 private:
  NodeGrid grid_;
  Eigen::Vector3d source_;
  std::array<float*, 3> images_;
  SlabSumScratch& scratch_;
  bool is_empty_ = true;
};

}  // namespace af
