// SPDX-License-Identifier: Apache-2.0
#include "volume/ray_caster_kernel.h"

#include "base/vec16.h"

namespace af::AF_KERNEL_NAMESPACE {

namespace {

struct Row {
  F16 low;
  F16 high;
};

AF_KERNEL_INLINE Row unpack(I16 pairs) {
  return {to_float(pairs & 0xFFFF),
          to_float(reinterpret_cast<I16>(reinterpret_cast<U16>(pairs) >> 16))};
}

AF_KERNEL_INLINE F16 mix(F16 a, F16 b, F16 weight) {
  return a + weight * (b - a);
}

AF_KERNEL_INLINE F16 sample(const VoxelView& volume, F16 x, F16 y, F16 z) {
  const I16 i = to_int(x);
  const I16 j = to_int(y);
  const I16 k = to_int(z);
  const F16 weight_x = x - to_float(i);
  const F16 weight_y = y - to_float(j);
  const F16 weight_z = z - to_float(k);
  const I16 offset = i + j * volume.row_stride + k * volume.slice_stride;
  const uint16_t* next_slice = volume.voxels + volume.slice_stride;
  const Row row_00 = unpack(gather_pairs(volume.voxels, offset));
  const Row row_10 = unpack(gather_pairs(volume.voxels + volume.row_stride, offset));
  const Row row_01 = unpack(gather_pairs(next_slice, offset));
  const Row row_11 = unpack(gather_pairs(next_slice + volume.row_stride, offset));
  const F16 low =
      mix(mix(row_00.low, row_10.low, weight_y), mix(row_01.low, row_11.low, weight_y), weight_z);
  const F16 high = mix(
      mix(row_00.high, row_10.high, weight_y), mix(row_01.high, row_11.high, weight_y), weight_z);
  return mix(low, high, weight_x);
}

}  // namespace

void sum_bundle(const VoxelView& volume, const RayBundle& bundle, float* sums) {
  const F16 start_x = load<F16>(bundle.start[0]);
  const F16 start_y = load<F16>(bundle.start[1]);
  const F16 start_z = load<F16>(bundle.start[2]);
  const F16 step_x = load<F16>(bundle.step[0]);
  const F16 step_y = load<F16>(bundle.step[1]);
  const F16 step_z = load<F16>(bundle.step[2]);
  const I16 samples = load<I16>(bundle.samples);
  F16 sum = splat(0.0f);
  for (int32_t k = 0;; ++k) {
    const I16 is_inside = samples > k;
    if (!any(is_inside)) break;
    // Lanes that are done sample their first position again and add nothing.
    const F16 position = to_float(is_inside ? splat(k) : splat(0));
    const F16 value = sample(volume,
                             start_x + position * step_x,
                             start_y + position * step_y,
                             start_z + position * step_z);
    sum += is_inside ? value : splat(0.0f);
  }
  store(sums, sum);
}

}  // namespace af::AF_KERNEL_NAMESPACE
