// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <stdint.h>

namespace af {

/// Sixteen rays, cut to the volume, in voxel indices. Sample k of ray r is at start + k * step.
struct RayBundle {
  static constexpr int kRays = 16;
  float start[3][kRays];
  float step[3][kRays];
  int32_t samples[kRays];
};

/// Voxels of a bordered volume, i fastest. Sample positions stay inside by at least a border cell's
/// edge.
struct VoxelView {
  const uint16_t* voxels;
  int32_t row_stride;    ///< elements from (i, j, k) to (i, j + 1, k)
  int32_t slice_stride;  ///< elements from (i, j, k) to (i, j, k + 1)
};

/// Sums of the trilinear samples of each ray, in units of the voxels.
using SumBundle = void (*)(const VoxelView& volume, const RayBundle& bundle, float* sums);

/// Sums over the samples of each ray, in units of the voxels.
struct SlopeSums {
  float values[RayBundle::kRays];
  float slopes[3][RayBundle::kRays];  ///< slopes of the interpolant, per voxel along i, j, k
  float numbered_slopes[3][RayBundle::kRays];  ///< each times the sample's number k
  /// Change of the sum when an end moves along the ray by one step. Its first (last) kStretched
  /// samples, or all when there are fewer, move along with it, less and less, and their weights
  /// change to match. It is about 0 in air, and the attenuation there where the volume's face cuts
  /// a body.
  static constexpr int kStretched = 16;
  float stretched_begin[RayBundle::kRays];
  float stretched_end[RayBundle::kRays];
};

/// The same values, bit for bit, with the sums of slopes.
using SumBundleWithSlopes = void (*)(const VoxelView& volume,
                                     const RayBundle& bundle,
                                     SlopeSums& sums);

namespace kernels_128 {
void sum_bundle(const VoxelView& volume, const RayBundle& bundle, float* sums);
void sum_bundle_with_slopes(const VoxelView& volume, const RayBundle& bundle, SlopeSums& sums);
}  // namespace kernels_128
namespace kernels_256 {
void sum_bundle(const VoxelView& volume, const RayBundle& bundle, float* sums);
void sum_bundle_with_slopes(const VoxelView& volume, const RayBundle& bundle, SlopeSums& sums);
}  // namespace kernels_256
namespace kernels_512 {
void sum_bundle(const VoxelView& volume, const RayBundle& bundle, float* sums);
void sum_bundle_with_slopes(const VoxelView& volume, const RayBundle& bundle, SlopeSums& sums);
}  // namespace kernels_512

}  // namespace af
