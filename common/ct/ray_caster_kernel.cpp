// SPDX-License-Identifier: Apache-2.0
#include "ct/ray_caster_kernel.h"

#include "base/processor.h"

namespace af::AF_KERNEL_NAMESPACE {

namespace {

using native::Floats;
using native::Ints;
using native::kLanes;
using native::load;
using native::splat;
using native::store;
using native::to_float;
using native::to_int;

struct Row {
  Floats low;
  Floats high;
};

AF_KERNEL_INLINE Row unpack(Ints pairs) {
  return {to_float(pairs & 0xFFFF), to_float(native::upper_halves(pairs))};
}

AF_KERNEL_INLINE Floats mix(Floats a, Floats b, Floats weight) {
  return a + weight * (b - a);
}

/// The interpolant on a face of a cell with fixed i.
struct Face {
  Floats value;
  Floats slope_y;
  Floats slope_z;
};

AF_KERNEL_INLINE Face
face_of(Floats at_00, Floats at_10, Floats at_01, Floats at_11, Floats weight_y, Floats weight_z) {
  const Floats edge_0 = at_10 - at_00;
  const Floats edge_1 = at_11 - at_01;
  const Floats value_0 = at_00 + weight_y * edge_0;
  const Floats slope_z = at_01 + weight_y * edge_1 - value_0;
  return {value_0 + weight_z * slope_z, mix(edge_0, edge_1, weight_z), slope_z};
}

/// The interpolant at one point of each ray, and its slopes per voxel.
struct Sample {
  Floats value;
  Floats slope[3];
};

AF_KERNEL_INLINE Sample sample(const VoxelView& volume, Floats x, Floats y, Floats z) {
  const Ints i = to_int(x);
  const Ints j = to_int(y);
  const Ints k = to_int(z);
  const Floats weight_x = x - to_float(i);
  const Floats weight_y = y - to_float(j);
  const Floats weight_z = z - to_float(k);
  const Ints offset = i + j * volume.row_stride + k * volume.slice_stride;
  const uint16_t* next_slice = volume.voxels + volume.slice_stride;
  const Row row_00 = unpack(native::gather_pairs(volume.voxels, offset));
  const Row row_10 = unpack(native::gather_pairs(volume.voxels + volume.row_stride, offset));
  const Row row_01 = unpack(native::gather_pairs(next_slice, offset));
  const Row row_11 = unpack(native::gather_pairs(next_slice + volume.row_stride, offset));
  const Face low = face_of(row_00.low, row_10.low, row_01.low, row_11.low, weight_y, weight_z);
  const Face high = face_of(row_00.high, row_10.high, row_01.high, row_11.high, weight_y, weight_z);
  return {mix(low.value, high.value, weight_x),
          {high.value - low.value,
           mix(low.slope_y, high.slope_y, weight_x),
           mix(low.slope_z, high.slope_z, weight_x)}};
}

/// Rays of a bundle in registers.
struct Rays {
  Floats start[3];
  Floats step[3];
  Ints samples;
};

AF_KERNEL_INLINE Rays rays_of(const RayBundle& bundle, int first) {
  Rays rays;
  for (int axis = 0; axis < 3; ++axis) {
    rays.start[axis] = load(bundle.start[axis] + first);
    rays.step[axis] = load(bundle.step[axis] + first);
  }
  memcpy(&rays.samples, bundle.samples + first, sizeof(rays.samples));
  return rays;
}

AF_KERNEL_INLINE Sample sample(const VoxelView& volume, const Rays& rays, Floats number) {
  return sample(volume,
                rays.start[0] + number * rays.step[0],
                rays.start[1] + number * rays.step[1],
                rays.start[2] + number * rays.step[2]);
}

/// Calls add(sample, number, is_inside) for the samples of all rays in turn. Finished lanes sample
/// their first position again.
template <typename Add>
AF_KERNEL_INLINE void for_each_sample(const VoxelView& volume, const Rays& rays, Add add) {
  for (int32_t k = 0;; ++k) {
    const Ints is_inside = rays.samples > k;
    if (!native::any(is_inside)) break;
    const Floats number = to_float(is_inside ? splat(k) : splat(0));
    add(sample(volume, rays, number), number, is_inside);
  }
}

/// SlopeSums::stretched_begin. With a growth of 1 and numbers backwards from the last, the end.
template <typename NumberOf>
AF_KERNEL_INLINE Floats
stretched(const VoxelView& volume, const Rays& rays, float growth, NumberOf number_of) {
  const Ints count = native::minimum(rays.samples, splat(int32_t{SlopeSums::kStretched}));
  const Floats share = splat(1.0f) / to_float(count);
  Floats sum = splat(0.0f);
  for (int32_t k = 0; k < SlopeSums::kStretched; ++k) {
    const Ints is_inside = count > k;
    if (!native::any(is_inside)) break;
    const Sample at = sample(volume, rays, to_float(is_inside ? number_of(k) : splat(0)));
    const Floats along =
        at.slope[0] * rays.step[0] + at.slope[1] * rays.step[1] + at.slope[2] * rays.step[2];
    const Floats moved = splat(1.0f) - (static_cast<float>(k) + 0.5f) * share;
    sum += is_inside ? moved * along + growth * share * at.value : splat(0.0f);
  }
  return sum;
}

}  // namespace

void sum_bundle(const VoxelView& volume, const RayBundle& bundle, float* sums) {
  for (int first = 0; first < RayBundle::kRays; first += kLanes) {
    Floats sum = splat(0.0f);
    for_each_sample(
        volume, rays_of(bundle, first), [&](const Sample& at, Floats /*number*/, Ints is_inside) {
          sum += is_inside ? at.value : splat(0.0f);
        });
    store(sums + first, sum);
  }
}

void sum_bundle_with_slopes(const VoxelView& volume, const RayBundle& bundle, SlopeSums& sums) {
  for (int first = 0; first < RayBundle::kRays; first += kLanes) {
    const Rays rays = rays_of(bundle, first);
    Floats value = splat(0.0f);
    Floats slope[3] = {splat(0.0f), splat(0.0f), splat(0.0f)};
    Floats numbered[3] = {splat(0.0f), splat(0.0f), splat(0.0f)};
    for_each_sample(volume, rays, [&](const Sample& at, Floats number, Ints is_inside) {
      value += is_inside ? at.value : splat(0.0f);
      for (int axis = 0; axis < 3; ++axis) {
        slope[axis] += is_inside ? at.slope[axis] : splat(0.0f);
        numbered[axis] += number * at.slope[axis];  // finished lanes have number 0
      }
    });
    store(sums.values + first, value);
    for (int axis = 0; axis < 3; ++axis) {
      store(sums.slopes[axis] + first, slope[axis]);
      store(sums.numbered_slopes[axis] + first, numbered[axis]);
    }
    store(sums.stretched_begin + first,
          stretched(volume, rays, -1.0f, [](int32_t k) { return splat(k); }));
    store(sums.stretched_end + first,
          stretched(volume, rays, 1.0f, [&](int32_t k) { return rays.samples - 1 - k; }));
  }
}

}  // namespace af::AF_KERNEL_NAMESPACE
