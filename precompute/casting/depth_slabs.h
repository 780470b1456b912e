// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "precompute/casting/slab_aligned_volume.h"

namespace af {

/// Where a CT is cut into K depth slabs, and the (s,t) plane of each, as make_light_slab() takes
/// them.
struct DepthSlabs {
  std::vector<double> boundaries_y_mm;  ///< K - 1, ascending, midway between two slices
  std::vector<double> st_plane_y_mm;    ///< K, ascending
};

/// Cuts slices of given attenuation into `slabs` runs such that the attenuation-weighted mean
/// squared distance of slices from their slab's centroid is least, because the blur of a coarse
/// (u,v) grid grows with that distance. Returns the first slice of each run except the first. Exact
/// (dynamic programming, slabs * slices^2 steps). Every slab attenuates. Throws InputError when
/// there are fewer attenuating slices than slabs.
/// \test DepthSlabs.CutIsTheBestOfAllCuts
std::vector<int> best_slice_cuts(std::span<const std::int64_t> slice_sums, int slabs);

/// Where the (s,t) planes are placed.
enum class StPlane {
  Centre,    ///< all through the field's centre, y = 0, as in the paper, for one slab
  Centroid,  ///< each at its slab's centroid of attenuation
};

/// The best cuts into `slabs` slabs, and their (s,t) planes.
DepthSlabs choose_depth_slabs(const SlabAlignedVolume& volume, int slabs, StPlane st_plane);
/// The same from the volume's slice_sums().
DepthSlabs choose_depth_slabs(const SlabAlignedGrid& grid,
                              std::span<const std::int64_t> slice_sums,
                              int slabs,
                              StPlane st_plane);

}  // namespace af
