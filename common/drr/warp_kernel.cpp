// SPDX-License-Identifier: Apache-2.0
#include "drr/warp_kernel.h"

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

/// The lanes of a row where the coordinates are least. Along a row of pixels coordinates grow or
/// fall, except for rounding.
struct LeastLanes {
  Ints s, t;
};

/// What a window holds. Picking from two registers tells 2 kLanes nodes apart: kLanes of two rows,
/// or twice as many of one.
enum class WindowShape : int32_t {
  NoWindow,  ///< registers cannot hold the cells: their nodes are gathered one by one
  TwoRows,   ///< lower nodes lie in kLanes columns and two rows
  FourRows,  ///< in kLanes columns and four rows
  Wide,      ///< in 2 kLanes columns and two rows
};

/// The part of a node image that registers hold for the cells of neighbouring pixels.
struct Window {
  int64_t first;  ///< number of its first node in the image
  Ints lane;      ///< each cell's lower s node; unless wide, kLanes more for cells in an odd row
  Ints row;       ///< each cell's lower t node, counted from the window's first
  WindowShape shape;
};

/// The cells of a node image that neighbouring pixels fall into, one per lane.
struct Cells {
  Floats inverse_depth;
  Floats s, t;                ///< node coordinates, clamped to the image
  Floats s_weight, t_weight;  ///< weights of the upper nodes
  Ints s_node, t_node;        ///< lower nodes
  Window window;
};

/// Upper limits of clamped coordinates: the largest numbers below those of the last node.
struct Limits {
  float s, t;
};

AF_KERNEL_INLINE float largest_below(int32_t positive) {
  const auto value = static_cast<float>(positive);
  int32_t bits = 0;
  memcpy(&bits, &value, sizeof(bits));
  --bits;
  float below = 0.0f;
  memcpy(&below, &bits, sizeof(below));
  return below;
}

AF_KERNEL_INLINE Floats clamped(Floats value, float limit) {
  return native::minimum(native::maximum(value, splat(0.0f)), splat(limit));
}

#if AF_VECTOR_BITS >= 256
AF_KERNEL_INLINE LeastLanes least_lanes(const WarpRow& row) {
  const bool s_rises = row.s_1 * row.d_0 > row.s_0 * row.d_1;
  const bool t_rises = row.t_1 * row.d_0 > row.t_0 * row.d_1;
  return {splat(s_rises ? 0 : kLanes - 1), splat(t_rises ? 0 : kLanes - 1)};
}

AF_KERNEL_INLINE Window window_of(const Cells& cells, const LeastLanes& least, int32_t stride) {
  const Ints first_s = native::pick(cells.s_node, least.s);
  const Ints first_t = native::pick(cells.t_node, least.t);
  const Ints column = cells.s_node - first_s;
  const Ints row = cells.t_node - first_t;
  Window window{static_cast<int64_t>(first_t[0]) * stride + first_s[0],
                column + row * kLanes,
                row,
                WindowShape::NoWindow};
  // No high bit is set exactly when both are at least 0 and within the window: column < kLanes and
  // row < 2 or 4, or column < 2 kLanes and row < 2.
  constexpr int32_t kHighBits = ~(kLanes - 1);
  if (!native::any_bit(column | row * (kLanes / 2), kHighBits)) {
    window.shape = WindowShape::TwoRows;
  } else if (!native::any_bit(column | row * (kLanes / 4), kHighBits)) {
    window.shape = WindowShape::FourRows;
  } else if (!native::any_bit(column | row * kLanes, kHighBits * 2)) {
    window.shape = WindowShape::Wide;
    window.lane = column;
  }
  return window;
}
#else
// Without instructions that pick lanes, all values must be gathered.
AF_KERNEL_INLINE LeastLanes least_lanes(const WarpRow& /*row*/) {
  return LeastLanes();
}
AF_KERNEL_INLINE Window window_of(const Cells& /*cells*/,
                                  const LeastLanes& /*least*/,
                                  int32_t /*stride*/) {
  return Window();
}
#endif

AF_KERNEL_INLINE Cells cells_of(const Limits& limits, const WarpRow& row, Floats column) {
  Cells cells{};
  cells.inverse_depth = splat(1.0f) / (row.d_0 + column * row.d_1);
  cells.s = clamped((row.s_0 + column * row.s_1) * cells.inverse_depth, limits.s);
  cells.t = clamped((row.t_0 + column * row.t_1) * cells.inverse_depth, limits.t);
  cells.s_node = native::to_int(cells.s);
  cells.t_node = native::to_int(cells.t);
  cells.s_weight = cells.s - to_float(cells.s_node);
  cells.t_weight = cells.t - to_float(cells.t_node);
  return cells;
}

/// Values interpolated along s in the two rows of each cell, and their differences along s.
struct RowPair {
  Floats low, high;
  Floats low_slope, high_slope;
};

/// The nodes of one column, in both rows of each cell.
struct Column {
  Floats low, high;
};

#if AF_VECTOR_BITS >= 256
AF_KERNEL_INLINE Floats pick_wide(const float* nodes, const Window& window) {
  return native::pick(load(nodes), load(nodes + kLanes), window.lane);
}

AF_KERNEL_INLINE Column pick_column(const float* nodes, int64_t stride, const Window& window) {
  if (window.shape == WindowShape::Wide) {
    const Floats row_1 = pick_wide(nodes + stride, window);
    const Ints is_upper = window.row >= 1;
    return {is_upper ? row_1 : pick_wide(nodes, window),
            is_upper ? pick_wide(nodes + 2 * stride, window) : row_1};
  }
  const Floats row_0 = load(nodes);
  const Floats row_1 = load(nodes + stride);
  const Floats row_2 = load(nodes + 2 * stride);
  const Column column{native::pick(row_0, row_1, window.lane),
                      native::pick(row_1, row_2, window.lane)};
  if (window.shape == WindowShape::TwoRows) return column;
  const Floats row_3 = load(nodes + 3 * stride);
  const Floats row_4 = load(nodes + 4 * stride);
  const Ints is_upper = window.row >= 2;
  return {is_upper ? native::pick(row_2, row_3, window.lane) : column.low,
          is_upper ? native::pick(row_3, row_4, window.lane) : column.high};
}
#endif

struct Corners {
  Column left, right;
};

AF_KERNEL_INLINE Corners gather_corners(const float* values, int32_t stride, const Cells& cells) {
  const Ints offset = cells.t_node * stride + cells.s_node;
  const float* next = values + stride;
  return {{native::gather(values, offset), native::gather(next, offset)},
          {native::gather(values + 1, offset), native::gather(next + 1, offset)}};
}

AF_KERNEL_INLINE Corners corners_of(const float* values, int32_t stride, const Cells& cells) {
#if AF_VECTOR_BITS >= 256
  if (cells.window.shape != WindowShape::NoWindow) {
    const float* first = values + cells.window.first;
    return {pick_column(first, stride, cells.window), pick_column(first + 1, stride, cells.window)};
  }
#endif
  return gather_corners(values, stride, cells);
}

AF_KERNEL_INLINE RowPair sample(const float* values, int32_t stride, const Cells& cells) {
  const Corners corners = corners_of(values, stride, cells);
  const Floats low_slope = corners.right.low - corners.left.low;
  const Floats high_slope = corners.right.high - corners.left.high;
  return {corners.left.low + cells.s_weight * low_slope,
          corners.left.high + cells.s_weight * high_slope,
          low_slope,
          high_slope};
}

AF_KERNEL_INLINE Floats value_of(const RowPair& pair, const Cells& cells) {
  return pair.low + cells.t_weight * (pair.high - pair.low);
}

AF_KERNEL_INLINE Floats product(const float (&factors)[3], const Floats (&vector)[3]) {
  return factors[0] * vector[0] + factors[1] * vector[1] + factors[2] * vector[2];
}

/// The direction (m_x, 1, m_z) of each cell's ray.
struct RayDirections {
  Floats m_x, m_z;
};

AF_KERNEL_INLINE RayDirections directions_of(const PoseSlopes& slopes, const Cells& cells) {
  return {cells.s * slopes.m_scale[0] + slopes.m_offset[0],
          cells.t * slopes.m_scale[1] + slopes.m_offset[1]};
}

/// The motion of the source parallel to the planes that does to each cell's ray what its whole
/// motion does. Motion along the ray changes nothing.
struct ParallelMotion {
  Floats x, z;
};

AF_KERNEL_INLINE ParallelMotion parallel_motion(const PoseSlopes& slopes, const RayDirections& m) {
  const float(&move)[3] = slopes.source_move;
  return {move[0] - m.m_x * move[1], move[2] - m.m_z * move[1]};
}

/// Slopes per node along s and t.
struct NodeSlopes {
  Floats s, t;
};

AF_KERNEL_INLINE NodeSlopes slopes_of(const RowPair& pair, const Cells& cells) {
  return {pair.low_slope + cells.t_weight * (pair.high_slope - pair.low_slope),
          pair.high - pair.low};
}

/// Neighbouring pixels of a row, one per lane. The last run of a row may have fewer.
struct PixelRun {
  int64_t offset;
  int32_t count;
};

AF_KERNEL_INLINE void put(const PixelRun& run, float* values, Floats value) {
  float* to = values + run.offset;
  if (run.count == kLanes) {
    store(to, value);
    return;
  }
  float lanes[kLanes];
  store(lanes, value);
  for (int32_t i = 0; i < run.count; ++i) to[i] = lanes[i];
}

/// Calls work(row, cells, run) for all pixels. Arguments come as copies: the compiler cannot know
/// that stores to pixels leave alone what references refer to, and would load it again and again.
template <typename Work>
AF_KERNEL_INLINE void for_each_run(NodeImage image,
                                   Homography homography,
                                   PixelGrid grid,
                                   Work work) {
  const Limits limits{largest_below(image.s_count - 1), largest_below(image.t_count - 1)};
  const Floats last_column = splat(static_cast<float>(grid.columns - 1));
  for (int32_t r = grid.row_begin; r < grid.row_end; ++r) {
    const WarpRow row = row_of(homography, r);
    const LeastLanes least = least_lanes(row);
    Floats column = to_float(native::lane_numbers());
    for (int32_t c = 0; c < grid.columns; c += kLanes) {
      const int32_t left = grid.columns - c;
      const PixelRun run{static_cast<int64_t>(r) * grid.columns + c, left < kLanes ? left : kLanes};
      Cells cells = cells_of(limits, row, native::minimum(column, last_column));
      cells.window = window_of(cells, least, image.stride);
      work(row, cells, run);
      column += static_cast<float>(kLanes);
    }
  }
}

}  // namespace

void warp_image(const NodeImage& image,
                const Homography& homography,
                const PixelGrid& grid,
                float* values) {
  const NodeImage from = image;
  for_each_run(
      from, homography, grid, [=](const WarpRow& /*row*/, const Cells& cells, const PixelRun& run) {
        put(run, values, value_of(sample(from.values, from.stride, cells), cells));
      });
}

void warp_moved_image(const NodeImage& image,
                      const PoseSlopes& given,
                      const Homography& homography,
                      const PixelGrid& grid,
                      float* values) {
  const NodeImage from = image;
  const PoseSlopes slopes = given;
  for_each_run(
      from, homography, grid, [=](const WarpRow& /*row*/, const Cells& cells, const PixelRun& run) {
        const Floats value = value_of(sample(from.values, from.stride, cells), cells);
        const Floats g_x = value_of(sample(slopes.source_x, from.stride, cells), cells);
        const Floats g_z = value_of(sample(slopes.source_z, from.stride, cells), cells);
        const ParallelMotion move = parallel_motion(slopes, directions_of(slopes, cells));
        put(run, values, value + (g_x * move.x + g_z * move.z));
      });
}

void warp_with_pose_slopes(const NodeImage& image,
                           const PoseSlopes& given,
                           const Homography& homography,
                           const PixelGrid& grid,
                           float* values,
                           float* planes,
                           int64_t plane_stride) {
  const NodeImage from = image;
  const PoseSlopes slopes = given;
  for_each_run(
      from, homography, grid, [=](const WarpRow& /*row*/, const Cells& cells, const PixelRun& run) {
        const RowPair pair = sample(from.values, from.stride, cells);
        const RowPair pair_x = sample(slopes.source_x, from.stride, cells);
        const RowPair pair_z = sample(slopes.source_z, from.stride, cells);
        const Floats g_x = value_of(pair_x, cells);
        const Floats g_z = value_of(pair_z, cells);
        const RayDirections m = directions_of(slopes, cells);
        const Floats m_x = m.m_x;
        const Floats m_z = m.m_z;
        const ParallelMotion move = parallel_motion(slopes, m);
        put(run, values, value_of(pair, cells) + (g_x * move.x + g_z * move.z));
        // The slopes of that sum. m changes along s and t, too.
        const NodeSlopes of_value = slopes_of(pair, cells);
        const NodeSlopes of_x = slopes_of(pair_x, cells);
        const NodeSlopes of_z = slopes_of(pair_z, cells);
        const float along_s = slopes.m_scale[0] * slopes.source_move[1];
        const float along_t = slopes.m_scale[1] * slopes.source_move[1];
        const Floats f_x = slopes.nodes_per_mm[0] *
                           (of_value.s + (of_x.s * move.x + of_z.s * move.z - along_s * g_x));
        const Floats f_z = slopes.nodes_per_mm[1] *
                           (of_value.t + (of_x.t * move.x + of_z.t * move.z - along_t * g_z));
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
  const NodeImage from = s_slopes;
  const auto s_row = static_cast<float>(homography.s[2]);
  const auto t_row = static_cast<float>(homography.t[2]);
  const auto d_row = static_cast<float>(homography.d[2]);
  for_each_run(
      from, homography, grid, [=](const WarpRow& row, const Cells& cells, const PixelRun& run) {
        const Floats along_s =
            cells.inverse_depth * value_of(sample(from.values, from.stride, cells), cells);
        const Floats along_t =
            cells.inverse_depth * value_of(sample(t_slopes, from.stride, cells), cells);
        put(run,
            column_slopes,
            along_s * (row.s_1 - cells.s * row.d_1) + along_t * (row.t_1 - cells.t * row.d_1));
        put(run,
            row_slopes,
            along_s * (s_row - cells.s * d_row) + along_t * (t_row - cells.t * d_row));
      });
}

}  // namespace af::AF_KERNEL_NAMESPACE
