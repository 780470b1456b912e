// SPDX-License-Identifier: Apache-2.0
#include "volume/ray_caster_kernel.h"

#include "base/vec16.h"

namespace af::AF_KERNEL_NAMESPACE {

namespace {

struct Row {
  Floats16 low;
  Floats16 high;
};

AF_KERNEL_INLINE Row unpack(Ints16 pairs) {
  return {to_float(pairs & 0xFFFF),
          to_float(reinterpret_cast<Ints16>(reinterpret_cast<UnsignedInts16>(pairs) >> 16))};
}

AF_KERNEL_INLINE Floats16 mix(Floats16 a, Floats16 b, Floats16 weight) {
  return a + weight * (b - a);
}

/// The interpolant on a face of a cell, i fixed.
struct Face {
  Floats16 value;
  Floats16 slope_y;
  Floats16 slope_z;
};

AF_KERNEL_INLINE Face face_of(Floats16 at_00,
                              Floats16 at_10,
                              Floats16 at_01,
                              Floats16 at_11,
                              Floats16 weight_y,
                              Floats16 weight_z) {
  const Floats16 edge_0 = at_10 - at_00;
  const Floats16 edge_1 = at_11 - at_01;
  const Floats16 value_0 = at_00 + weight_y * edge_0;
  const Floats16 slope_z = at_01 + weight_y * edge_1 - value_0;
  return {value_0 + weight_z * slope_z, mix(edge_0, edge_1, weight_z), slope_z};
}

/// The interpolant at one point of each ray, its slopes per voxel.
struct Sample {
  Floats16 value;
  Floats16 slope[3];
};

AF_KERNEL_INLINE Sample sample(const VoxelView& volume, Floats16 x, Floats16 y, Floats16 z) {
  const Ints16 i = to_int(x);
  const Ints16 j = to_int(y);
  const Ints16 k = to_int(z);
  const Floats16 weight_x = x - to_float(i);
  const Floats16 weight_y = y - to_float(j);
  const Floats16 weight_z = z - to_float(k);
  const Ints16 offset = i + j * volume.row_stride + k * volume.slice_stride;
  const uint16_t* next_slice = volume.voxels + volume.slice_stride;
  const Row row_00 = unpack(gather_pairs(volume.voxels, offset));
  const Row row_10 = unpack(gather_pairs(volume.voxels + volume.row_stride, offset));
  const Row row_01 = unpack(gather_pairs(next_slice, offset));
  const Row row_11 = unpack(gather_pairs(next_slice + volume.row_stride, offset));
  const Face low = face_of(row_00.low, row_10.low, row_01.low, row_11.low, weight_y, weight_z);
  const Face high = face_of(row_00.high, row_10.high, row_01.high, row_11.high, weight_y, weight_z);
  return {mix(low.value, high.value, weight_x),
          {high.value - low.value,
           mix(low.slope_y, high.slope_y, weight_x),
           mix(low.slope_z, high.slope_z, weight_x)}};
}

/// A bundle in registers.
struct Rays {
  Floats16 start[3];
  Floats16 step[3];
  Ints16 samples;
};

AF_KERNEL_INLINE Rays rays_of(const RayBundle& bundle) {
  return {{load<Floats16>(bundle.start[0]),
           load<Floats16>(bundle.start[1]),
           load<Floats16>(bundle.start[2])},
          {load<Floats16>(bundle.step[0]),
           load<Floats16>(bundle.step[1]),
           load<Floats16>(bundle.step[2])},
          load<Ints16>(bundle.samples)};
}

AF_KERNEL_INLINE Sample sample(const VoxelView& volume, const Rays& rays, Floats16 number) {
  return sample(volume,
                rays.start[0] + number * rays.step[0],
                rays.start[1] + number * rays.step[1],
                rays.start[2] + number * rays.step[2]);
}

/// Calls add(sample, number, is_inside) for the samples of all rays in turn. Lanes that are done
/// sample their first position again.
template <typename Add>
AF_KERNEL_INLINE void for_each_sample(const VoxelView& volume, const Rays& rays, Add add) {
  for (int32_t k = 0;; ++k) {
    const Ints16 is_inside = rays.samples > k;
    if (!any(is_inside)) break;
    const Floats16 number = to_float(is_inside ? splat(k) : splat(0));
    add(sample(volume, rays, number), number, is_inside);
  }
}

/// SlopeSums::stretched_begin or, by a growth of 1 and numbers backwards from the last, the end.
template <typename NumberOf>
AF_KERNEL_INLINE Floats16
stretched(const VoxelView& volume, const Rays& rays, float growth, NumberOf number_of) {
  const Ints16 count = minimum(rays.samples, splat(int32_t{SlopeSums::kStretched}));
  const Floats16 share = splat(1.0f) / to_float(count);
  Floats16 sum = splat(0.0f);
  for (int32_t k = 0; k < SlopeSums::kStretched; ++k) {
    const Ints16 is_inside = count > k;
    if (!any(is_inside)) break;
    const Sample at = sample(volume, rays, to_float(is_inside ? number_of(k) : splat(0)));
    const Floats16 along =
        at.slope[0] * rays.step[0] + at.slope[1] * rays.step[1] + at.slope[2] * rays.step[2];
    const Floats16 moved = splat(1.0f) - (static_cast<float>(k) + 0.5f) * share;
    sum += is_inside ? moved * along + growth * share * at.value : splat(0.0f);
  }
  return sum;
}

}  // namespace

void sum_bundle(const VoxelView& volume, const RayBundle& bundle, float* sums) {
  Floats16 sum = splat(0.0f);
  for_each_sample(
      volume, rays_of(bundle), [&](const Sample& at, Floats16 /*number*/, Ints16 is_inside) {
        sum += is_inside ? at.value : splat(0.0f);
      });
  store(sums, sum);
}

void sum_bundle_with_slopes(const VoxelView& volume, const RayBundle& bundle, SlopeSums& sums) {
  const Rays rays = rays_of(bundle);
  Floats16 value = splat(0.0f);
  Floats16 slope[3] = {splat(0.0f), splat(0.0f), splat(0.0f)};
  Floats16 numbered[3] = {splat(0.0f), splat(0.0f), splat(0.0f)};
  for_each_sample(volume, rays, [&](const Sample& at, Floats16 number, Ints16 is_inside) {
    value += is_inside ? at.value : splat(0.0f);
    for (int axis = 0; axis < 3; ++axis) {
      slope[axis] += is_inside ? at.slope[axis] : splat(0.0f);
      numbered[axis] += number * at.slope[axis];  // done lanes have number 0
    }
  });
  store(sums.values, value);
  for (int axis = 0; axis < 3; ++axis) {
    store(sums.slopes[axis], slope[axis]);
    store(sums.numbered_slopes[axis], numbered[axis]);
  }
  store(sums.stretched_begin, stretched(volume, rays, -1.0f, [](int32_t k) { return splat(k); }));
  store(sums.stretched_end,
        stretched(volume, rays, 1.0f, [&](int32_t k) { return rays.samples - 1 - k; }));
}

}  // namespace af::AF_KERNEL_NAMESPACE
