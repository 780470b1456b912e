// SPDX-License-Identifier: Apache-2.0
#include "drr/warp_kernel.h"

#include "base/vec_native.h"

namespace af::AF_KERNEL_NAMESPACE {

namespace {

using native::Floats;
using native::Ints;
using native::kLanes;
using native::load;
using native::splat;
using native::store;
using native::to_float;

/// One detector row of a homography.
struct WarpRow {
  float s_0, s_1;
  float t_0, t_1;
  float d_0, d_1;
};

WarpRow row_of(const Homography& h, int32_t row) {
  return {static_cast<float>(h.s[0] + row * h.s[2]),
          static_cast<float>(h.s[1]),
          static_cast<float>(h.t[0] + row * h.t[2]),
          static_cast<float>(h.t[1]),
          static_cast<float>(h.d[0] + row * h.d[2]),
          static_cast<float>(h.d[1])};
}

/// The cells of a node image that neighbouring pixels fall into, one per lane.
struct Cells {
  Floats inverse_depth;
  Floats s, t;                ///< node coordinates, not below 0
  Floats s_weight, t_weight;  ///< of the upper nodes
  Ints s_node, t_node;        ///< lower nodes
  int32_t first_s;            ///< least of s_node
  int32_t first_t, last_t;
  bool is_compact;  ///< few rows of at most kLanes nodes hold all cells
};

/// Rows up to which picking from registers beats gathering.
inline constexpr int32_t kMostRows = 8;

/// Finds out whether registers can hold the cells. Along a row of pixels the coordinates run one
/// way, but for rounding.
AF_NATIVE_INLINE void measure(Cells& cells) {
#if AF_VECTOR_BITS >= 256
  const int32_t s_ends[2] = {cells.s_node[0], cells.s_node[kLanes - 1]};
  const int32_t t_ends[2] = {cells.t_node[0], cells.t_node[kLanes - 1]};
  const bool s_rises = s_ends[0] < s_ends[1];
  const bool t_rises = t_ends[0] < t_ends[1];
  cells.first_s = s_rises ? s_ends[0] : s_ends[1];
  cells.first_t = t_rises ? t_ends[0] : t_ends[1];
  cells.last_t = t_rises ? t_ends[1] : t_ends[0];
  cells.is_compact =
      cells.last_t - cells.first_t < kMostRows &&
      !native::any_outside(cells.s_node, cells.first_s, cells.first_s + kLanes - 1) &&
      !native::any_outside(cells.t_node, cells.first_t, cells.last_t);
#else
  cells.is_compact = false;
#endif
}

AF_NATIVE_INLINE Cells cells_of(const NodeImage& image, const WarpRow& row, Floats column) {
  Cells cells{};
  cells.inverse_depth = splat(1.0f) / (row.d_0 + column * row.d_1);
  const Floats zero = splat(0.0f);
  cells.s = native::maximum(zero, (row.s_0 + column * row.s_1) * cells.inverse_depth);
  cells.t = native::maximum(zero, (row.t_0 + column * row.t_1) * cells.inverse_depth);
  cells.s_node = native::minimum(native::to_int(cells.s), splat(image.s_count - 2));
  cells.t_node = native::minimum(native::to_int(cells.t), splat(image.t_count - 2));
  cells.s_weight = native::minimum(cells.s - to_float(cells.s_node), splat(1.0f));
  cells.t_weight = native::minimum(cells.t - to_float(cells.t_node), splat(1.0f));
  measure(cells);
  return cells;
}

/// Interpolated along s in the two rows of each cell, and the differences along s.
struct RowPair {
  Floats low, high;
  Floats low_slope, high_slope;
};

#if AF_VECTOR_BITS >= 256
struct RowSample {
  Floats value, slope;
};

AF_NATIVE_INLINE RowSample sample_row(const float* row, Ints lane, Floats weight) {
  const Floats left = native::pick(load(row), lane);
  const Floats slope = native::pick(load(row + 1), lane) - left;
  return {left + weight * slope, slope};
}

AF_NATIVE_INLINE RowPair sample_compact(const float* values, int32_t stride, const Cells& cells) {
  const float* row = values + static_cast<int64_t>(cells.first_t) * stride + cells.first_s;
  const Ints lane = cells.s_node - cells.first_s;
  const RowSample first = sample_row(row, lane, cells.s_weight);
  RowSample last = sample_row(row + stride, lane, cells.s_weight);
  RowPair pair{first.value, last.value, first.slope, last.slope};
  // At least once, whether needed or not: cheaper than a branch that is often mispredicted.
  int32_t t = cells.first_t + 1;
  do {
    row += stride;
    const RowSample next = sample_row(row + stride, lane, cells.s_weight);
    const Ints is_beyond = cells.t_node >= t;
    pair.low = is_beyond ? last.value : pair.low;
    pair.high = is_beyond ? next.value : pair.high;
    pair.low_slope = is_beyond ? last.slope : pair.low_slope;
    pair.high_slope = is_beyond ? next.slope : pair.high_slope;
    last = next;
  } while (++t <= cells.last_t);
  return pair;
}
#endif

AF_NATIVE_INLINE RowPair sample_scattered(const float* values, int32_t stride, const Cells& cells) {
  const Ints offset = cells.t_node * stride + cells.s_node;
  const float* next = values + stride;
  RowPair pair{};
  const Floats low = native::gather(values, offset);
  const Floats high = native::gather(next, offset);
  pair.low_slope = native::gather(values + 1, offset) - low;
  pair.high_slope = native::gather(next + 1, offset) - high;
  pair.low = low + cells.s_weight * pair.low_slope;
  pair.high = high + cells.s_weight * pair.high_slope;
  return pair;
}

AF_NATIVE_INLINE RowPair sample(const float* values, int32_t stride, const Cells& cells) {
#if AF_VECTOR_BITS >= 256
  if (cells.is_compact) return sample_compact(values, stride, cells);
#endif
  return sample_scattered(values, stride, cells);
}

AF_NATIVE_INLINE Floats value_of(const RowPair& pair, const Cells& cells) {
  return pair.low + cells.t_weight * (pair.high - pair.low);
}

AF_NATIVE_INLINE Floats product(const float (&factors)[3], const Floats (&vector)[3]) {
  return factors[0] * vector[0] + factors[1] * vector[1] + factors[2] * vector[2];
}

/// Neighbouring pixels of a row, one per lane; the last ones of a row may be fewer.
struct PixelRun {
  int64_t offset;
  int32_t count;
  bool adds;
};

AF_NATIVE_INLINE void put(const PixelRun& run, float* values, Floats value) {
  float* to = values + run.offset;
  if (run.count == kLanes) {
    store(to, run.adds ? load(to) + value : value);
    return;
  }
  float lanes[kLanes];
  store(lanes, value);
  for (int32_t i = 0; i < run.count; ++i) to[i] = run.adds ? to[i] + lanes[i] : lanes[i];
}

/// Calls work(row, columns of the lanes, run) for all pixels.
template <typename Work>
AF_NATIVE_INLINE void for_each_run(const Homography& homography, const PixelGrid& grid, Work work) {
  const Ints lane = native::lane_numbers();
  for (int32_t r = grid.row_begin; r < grid.row_end; ++r) {
    const WarpRow row = row_of(homography, r);
    for (int32_t c = 0; c < grid.columns; c += kLanes) {
      const int32_t left = grid.columns - c;
      const PixelRun run{
          static_cast<int64_t>(r) * grid.columns + c, left < kLanes ? left : kLanes, grid.adds};
      work(row, to_float(native::minimum(lane + c, splat(grid.columns - 1))), run);
    }
  }
}

}  // namespace

void warp_image(const NodeImage& image,
                const Homography& homography,
                const PixelGrid& grid,
                float* values) {
  for_each_run(homography, grid, [&](const WarpRow& row, Floats column, const PixelRun& run) {
    const Cells cells = cells_of(image, row, column);
    put(run, values, value_of(sample(image.values, image.stride, cells), cells));
  });
}

void warp_with_pose_slopes(const NodeImage& image,
                           const PoseSlopes& slopes,
                           const Homography& homography,
                           const PixelGrid& grid,
                           float* values,
                           float* planes,
                           int64_t plane_stride) {
  for_each_run(homography, grid, [&](const WarpRow& row, Floats column, const PixelRun& run) {
    const Cells cells = cells_of(image, row, column);
    const RowPair pair = sample(image.values, image.stride, cells);
    put(run, values, value_of(pair, cells));
    const Floats f_x = slopes.nodes_per_mm[0] *
                       (pair.low_slope + cells.t_weight * (pair.high_slope - pair.low_slope));
    const Floats f_z = slopes.nodes_per_mm[1] * (pair.high - pair.low);
    const Floats g_x = value_of(sample(slopes.source_x, image.stride, cells), cells);
    const Floats g_z = value_of(sample(slopes.source_z, image.stride, cells), cells);
    const Floats m_x = cells.s * slopes.m_scale[0] + slopes.m_offset[0];
    const Floats m_z = cells.t * slopes.m_scale[1] + slopes.m_offset[1];
    // Forces are perpendicular to the ray.
    const Floats f_y = -(m_x * f_x + m_z * f_z);
    const Floats force[3] = {f_x + g_x, f_y - (m_x * g_x + m_z * g_z), f_z + g_z};
    const Floats moment[3] = {f_z - m_z * f_y, m_z * f_x - m_x * f_z, m_x * f_y - f_x};
    for (int axis = 0; axis < 3; ++axis) {
      put(run,
          planes + axis * plane_stride,
          product(slopes.rotation_of_moment[axis], moment) +
              product(slopes.rotation_of_force[axis], force));
      put(run,
          planes + (axis + 3) * plane_stride,
          product(slopes.translation_of_force[axis], force));
    }
  });
}

void warp_slopes(const NodeImage& s_slopes,
                 const float* t_slopes,
                 const Homography& homography,
                 const PixelGrid& grid,
                 float* column_slopes,
                 float* row_slopes) {
  const auto s_row = static_cast<float>(homography.s[2]);
  const auto t_row = static_cast<float>(homography.t[2]);
  const auto d_row = static_cast<float>(homography.d[2]);
  for_each_run(homography, grid, [&](const WarpRow& row, Floats column, const PixelRun& run) {
    const Cells cells = cells_of(s_slopes, row, column);
    const Floats along_s =
        cells.inverse_depth * value_of(sample(s_slopes.values, s_slopes.stride, cells), cells);
    const Floats along_t =
        cells.inverse_depth * value_of(sample(t_slopes, s_slopes.stride, cells), cells);
    put(run,
        column_slopes,
        along_s * (row.s_1 - cells.s * row.d_1) + along_t * (row.t_1 - cells.t * row.d_1));
    put(run, row_slopes, along_s * (s_row - cells.s * d_row) + along_t * (t_row - cells.t * d_row));
  });
}

}  // namespace af::AF_KERNEL_NAMESPACE
