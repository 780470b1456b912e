// SPDX-License-Identifier: Apache-2.0
#include "geometry/point_distances_kernel.h"

#include "base/processor.h"

namespace af::AF_KERNEL_NAMESPACE {

namespace {

constexpr int kLanes = AF_VECTOR_BITS / 64;
constexpr int kParts = 8;  // partial sums, the same for every vector width
constexpr int kGroups = kParts / kLanes;

using native::Doubles;

struct Vectors {
  Doubles x, y, z;
};

AF_KERNEL_INLINE Vectors load(const double* points) {
  Vectors loaded;
  for (int lane = 0; lane < kLanes; ++lane) {
    loaded.x[lane] = points[3 * lane];
    loaded.y[lane] = points[3 * lane + 1];
    loaded.z[lane] = points[3 * lane + 2];
  }
  return loaded;
}

AF_KERNEL_INLINE Doubles row(const PointMap& map, int i, const Vectors& point) {
  return map.matrix[i][0] * point.x + map.matrix[i][1] * point.y + map.matrix[i][2] * point.z +
         map.offset[i];
}

AF_KERNEL_INLINE Vectors mapped(const PointMap& map, const Vectors& point) {
  return {row(map, 0, point), row(map, 1, point), row(map, 2, point)};
}

AF_KERNEL_INLINE Doubles length(const Vectors& vector) {
  return native::square_root(vector.x * vector.x + vector.y * vector.y + vector.z * vector.z);
}

/// Partial sums of eight points each, added pairwise.
struct PartialSums {
  Doubles groups[kGroups];

  __attribute__((always_inline)) static inline void clear(PartialSums& sums) {
    for (Doubles& group : sums.groups) group = Doubles{};
  }
  __attribute__((always_inline)) static inline double total(const PartialSums& sums) {
    double parts[kParts];
    __builtin_memcpy(parts, sums.groups, sizeof(parts));
    return ((parts[0] + parts[1]) + (parts[2] + parts[3])) +
           ((parts[4] + parts[5]) + (parts[6] + parts[7]));
  }
};

/// Calls add(group, points, weights) for every register of points. Copies of the last point, with
/// weight 0, fill the last block.
template <typename Add>
AF_KERNEL_INLINE void for_each_register(const double* points, int64_t count, Add add) {
  const Doubles one = Doubles{} + 1.0;
  int64_t i = 0;
  for (; i + kParts <= count; i += kParts)
    for (int group = 0; group < kGroups; ++group)
      add(group, load(points + 3 * (i + group * kLanes)), one);
  if (i == count) return;
  double rest[3 * kParts];
  double weights[kParts];
  for (int part = 0; part < kParts; ++part) {
    const int64_t from = i + part < count ? i + part : count - 1;
    for (int axis = 0; axis < 3; ++axis) rest[3 * part + axis] = points[3 * from + axis];
    weights[part] = i + part < count ? 1.0 : 0.0;
  }
  for (int group = 0; group < kGroups; ++group) {
    Doubles weight;
    __builtin_memcpy(&weight, weights + group * kLanes, sizeof(weight));
    add(group, load(rest + 3 * group * kLanes), weight);
  }
}

}  // namespace

double sum_lengths(const double* points, int64_t count, const PointMap& map) {
  PartialSums sums;
  PartialSums::clear(sums);
  for_each_register(points, count, [&](int group, const Vectors& point, Doubles weight) {
    sums.groups[group] += weight * length(mapped(map, point));
  });
  return PartialSums::total(sums);
}

ProjectionSums sum_projections(const double* points,
                               int64_t count,
                               const PointMap& camera_from_ct,
                               const PointMap& gold_camera_from_ct) {
  PartialSums reprojection;
  PartialSums slope;
  PartialSums::clear(reprojection);
  PartialSums::clear(slope);
  Doubles smallest_depth = Doubles{} + __builtin_inf();
  for_each_register(points, count, [&](int group, const Vectors& point, Doubles weight) {
    const Vectors here = mapped(camera_from_ct, point);
    const Vectors gold = mapped(gold_camera_from_ct, point);
    // (gold - here) x here equals gold x here, without its cancellation.
    const Vectors shift = {gold.x - here.x, gold.y - here.y, gold.z - here.z};
    const Vectors cross = {shift.y * here.z - shift.z * here.y,
                           shift.z * here.x - shift.x * here.z,
                           shift.x * here.y - shift.y * here.x};
    reprojection.groups[group] += weight * (length(cross) / length(here));
    const Doubles column = here.x / here.z - gold.x / gold.z;
    const Doubles line = here.y / here.z - gold.y / gold.z;
    slope.groups[group] += weight * native::square_root(column * column + line * line);
    smallest_depth = here.z < smallest_depth ? here.z : smallest_depth;
    smallest_depth = gold.z < smallest_depth ? gold.z : smallest_depth;
  });
  double depth = __builtin_inf();
  for (int lane = 0; lane < kLanes; ++lane)
    depth = smallest_depth[lane] < depth ? smallest_depth[lane] : depth;
  return {PartialSums::total(reprojection), PartialSums::total(slope), depth};
}

}  // namespace af::AF_KERNEL_NAMESPACE
