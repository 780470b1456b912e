// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <stdint.h>

namespace af {

/// Sixteen rays, cut to the volume, in voxel indices: sample k of ray r is at start + k * step.
struct RayBundle {
  static constexpr int kRays = 16;
  float start[3][kRays];
  float step[3][kRays];
  int32_t samples[kRays];
};

/// Voxels of a bordered volume, i fastest; sample positions stay at least a border cell's edge
/// inside.
struct VoxelView {
  const uint16_t* voxels;
  int32_t row_stride;    ///< elements from (i, j, k) to (i, j + 1, k)
  int32_t slice_stride;  ///< elements from (i, j, k) to (i, j, k + 1)
};

/// Sums of the trilinear samples of each ray, in units of the voxels.
using SumBundle = void (*)(const VoxelView& volume, const RayBundle& bundle, float* sums);

namespace kernels_128 {
void sum_bundle(const VoxelView& volume, const RayBundle& bundle, float* sums);
}
namespace kernels_256 {
void sum_bundle(const VoxelView& volume, const RayBundle& bundle, float* sums);
}
namespace kernels_512 {
void sum_bundle(const VoxelView& volume, const RayBundle& bundle, float* sums);
}

}  // namespace af
