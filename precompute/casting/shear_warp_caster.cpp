// SPDX-License-Identifier: Apache-2.0
#include "precompute/casting/shear_warp_caster.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/error.h"
#include "base/vector_width.h"
#include "precompute/casting/shear_warp_kernel.h"

namespace af {

namespace {

/// Most x in the first pass's buffer, each with kShearColumns t nodes. This is 512 KiB, about half
/// of a second-level cache.
constexpr int kMostBufferedX = 8192;
static_assert(kRowBlock == kShearColumns && kRunOfT == kShearColumns,
              "interpolate_columns writes x in whole blocks of what is stored, for a run of t");

/// A linear map from node numbers of s or t to grid indices of one slice, for viewpoints at p:
/// index = per_viewpoint_mm * p + at_first_node + per_node * node.
struct NodeMap {
  double per_viewpoint_mm = 0.0;
  double at_first_node = 0.0;
  double per_node = 0.0;

  NodeMap() = default;
  /// `nearness` l: 0 in the (u,v) plane, 1 in the (s,t) plane.
  NodeMap(const GridAxis& nodes, double nearness, double origin_mm, double spacing_mm)
      : per_viewpoint_mm((1.0 - nearness) / spacing_mm),
        at_first_node((nearness * nodes.first_mm - origin_mm) / spacing_mm),
        per_node(nearness * nodes.spacing_mm() / spacing_mm) {}

  [[nodiscard]] double start(double viewpoint_mm) const {
    return per_viewpoint_mm * viewpoint_mm + at_first_node;
  }
  [[nodiscard]] double index(double viewpoint_mm, int node) const {
    return start(viewpoint_mm) + per_node * node;
  }
};

struct Slice {
  int y = 0;
  NodeMap x_of_s;
  NodeMap z_of_t;
  /// The x that the unit's rays can meet. The first pass computes no others.
  int first_x = 0;
  int last_x = 0;
};

/// A slice that matters for one run of t nodes, and its place in the buffer.
struct ActiveSlice {
  const Slice* slice = nullptr;
  int first_x = 0;  ///< first x in the buffer, a multiple of kRowBlock
  int low_x = 0;    ///< an x of zeros, or one that no ray reaches
  int high_x = 0;   ///< likewise
  int x_count = 0;
  ShearColumns columns{};
};

struct Kernels {
  shear_warp::InterpolateColumns interpolate_columns =
      select_kernel<shear_warp::InterpolateColumns>(kernels_128::interpolate_columns,
                                                    kernels_256::interpolate_columns,
                                                    kernels_512::interpolate_columns);
  shear_warp::AccumulateNodes accumulate_nodes = select_kernel<shear_warp::AccumulateNodes>(
      kernels_128::accumulate_nodes, kernels_256::accumulate_nodes, kernels_512::accumulate_nodes);
  shear_warp::QuantizeNode quantize_node = select_kernel<shear_warp::QuantizeNode>(
      kernels_128::quantize_node, kernels_256::quantize_node, kernels_512::quantize_node);
};

/// Casts one unit.
class UnitCast {
 public:
  UnitCast(const SlabAlignedVolume& volume,
           const LightSlab& light_slab,
           const AttenuationQuantizer& quantizer,
           const WorkUnit& unit,
           std::span<std::uint16_t> samples)
      : volume_(volume),
        light_slab_(light_slab),
        slab_(light_slab.slabs[unit.slab]),
        quantizer_(quantizer),
        unit_(unit),
        samples_(samples),
        plane_distance_mm_(light_slab.uv_plane_y_mm - slab_.st_plane_y_mm),
        buffer_(buffer_values(volume.grid())),
        sums_(static_cast<std::size_t>(unit.u.count) * static_cast<std::size_t>(unit.s.count) *
              kShearColumns) {
    const SlabAlignedGrid& grid = volume.grid();
    const auto [first, end] = grid.slice_range(slab_.y_low_mm, slab_.y_high_mm);
    for (int y = first; y < end; ++y) add_slice(y);
  }

  void run() {
    for (int v = unit_.v.begin; v < unit_.v.end(); ++v)
      for (int t = unit_.t.begin; t < unit_.t.end(); t += kShearColumns)
        cast_run(v, t, std::min(kShearColumns, unit_.t.end() - t));
  }

 private:
  /// Room for kMostBufferedX, or for a single slice that needs more.
  static std::size_t buffer_values(const SlabAlignedGrid& grid) {
    return static_cast<std::size_t>(std::max(kMostBufferedX, grid.size[0] + 3 * kRowBlock)) *
           kShearColumns;
  }

  void add_slice(int y) {
    const SlabAlignedGrid& grid = volume_.grid();
    Slice slice;
    slice.y = y;
    const double nearness = (light_slab_.uv_plane_y_mm - grid.slice_y_mm(y)) / plane_distance_mm_;
    const Eigen::Vector3d origin_mm = grid.slice_origin_mm(y);
    slice.x_of_s = NodeMap(slab_.s, nearness, origin_mm.x(), grid.spacing_mm.x());
    slice.z_of_t = NodeMap(slab_.t, nearness, origin_mm.z(), grid.spacing_mm.z());
    // x is linear in u and in s, so the corners of the unit decide.
    double low = grid.size[0];
    double high = 0.0;
    for (const int u : {unit_.u.begin, unit_.u.end() - 1})
      for (const int s : {unit_.s.begin, unit_.s.end() - 1}) {
        const double x = slice.x_of_s.index(light_slab_.u.position_mm(u), s);
        low = std::min(low, x);
        high = std::max(high, x);
      }
    slice.first_x = static_cast<int>(std::clamp(std::floor(low) - 1.0, 0.0, grid.size[0] - 1.0));
    slice.last_x = static_cast<int>(std::clamp(std::ceil(high) + 1.0, 0.0, grid.size[0] - 1.0));
    slices_.push_back(slice);
  }

  void cast_run(int v, int first_t, int t_count) {
    std::fill(sums_.begin(), sums_.end(), 0);
    active_.clear();
    int buffered = 0;
    bool is_empty = true;
    for (const Slice& slice : slices_) {
      const ActiveSlice active = activate(slice, light_slab_.v.position_mm(v), first_t, t_count);
      if (active.x_count == 0) continue;
      if (active_.size() == kShearSlices ||
          (!active_.empty() && buffered + active.x_count > kMostBufferedX)) {
        add_block();
        active_.clear();
        buffered = 0;
      }
      active_.push_back(active);
      buffered += active.x_count;
      is_empty = false;
    }
    if (!active_.empty()) add_block();
    write_samples(v, first_t, t_count, is_empty);
  }

  /// The part of the slice that a run's rays meet. It has no x when these are only zeros.
  [[nodiscard]] ActiveSlice activate(const Slice& slice,
                                     double v_mm,
                                     int first_t,
                                     int t_count) const {
    const SlabAlignedGrid& grid = volume_.grid();
    ActiveSlice active;
    active.slice = &slice;
    const double z_first = slice.z_of_t.index(v_mm, first_t);
    const double z_last = slice.z_of_t.index(v_mm, first_t + t_count - 1);
    const int low_row = static_cast<int>(std::floor(std::clamp(z_first, 0.0, 1.0 * grid.size[2])));
    const int high_row =
        static_cast<int>(std::floor(std::clamp(z_last, -1.0, grid.size[2] - 2.0))) + 1;
    int begin = grid.size[0];
    int end = 0;
    for (int z = low_row; z <= high_row; ++z) {
      const GridRow& row = volume_.row(slice.y, z);
      if (row.begin == row.end) continue;
      begin = std::min<int>(begin, row.begin);
      end = std::max<int>(end, row.end);
    }
    active.low_x = std::max(begin - 1, slice.first_x);
    active.high_x = std::min(end, slice.last_x);
    if (active.high_x <= active.low_x) return active;
    active.first_x = active.low_x / kRowBlock * kRowBlock;
    // This includes the x after high_x, which is read with a weight of 0.
    active.x_count = (active.high_x + 1 - active.first_x + kRowBlock) / kRowBlock * kRowBlock;
    fill_columns(slice, v_mm, first_t, t_count, active.columns);
    return active;
  }

  void fill_columns(
      const Slice& slice, double v_mm, int first_t, int t_count, ShearColumns& columns) const {
    constexpr int kWeightBits = 15;
    const SlabAlignedGrid& grid = volume_.grid();
    columns.values = volume_.values();
    columns.whole_begin = 0;
    columns.whole_end = grid.size[0];
    const double last_row = grid.size[2] - 2.0;
    for (int j = 0; j < kShearColumns; ++j) {
      // Beyond the grid, and beyond the last node, rows point to the row of zeros at z = 0.
      const double z = j < t_count ? slice.z_of_t.index(v_mm, first_t + j) : 0.0;
      const bool is_inside = z > 0.0 && z < last_row + 1.0;
      const auto fixed = is_inside
                             ? static_cast<std::int32_t>(std::floor(z * (1 << kWeightBits) + 0.5))
                             : std::int32_t{0};
      const int row = std::min(fixed >> kWeightBits, grid.size[2] - 2);
      columns.lower[j] = shear_row(slice.y, row);
      columns.upper[j] = shear_row(slice.y, row + 1);
      for (const ShearRow& stored : {columns.lower[j], columns.upper[j]}) {
        columns.whole_begin = std::max(columns.whole_begin, stored.begin);
        columns.whole_end = std::min(columns.whole_end, stored.begin + stored.count);
      }
      // The last row is 0, so at its very edge a weight of all but 1/32768 is as good as 1.
      columns.weight[j] =
          static_cast<std::int16_t>(std::min(fixed - (row << kWeightBits), (1 << kWeightBits) - 1));
    }
  }

  [[nodiscard]] ShearRow shear_row(int y, int z) const {
    const GridRow& row = volume_.row(y, z);
    return {row.origin_offset(),
            kRowBlock * row.first_block(),
            kRowBlock * (row.end_block() - row.first_block())};
  }

  /// Runs both passes over the active slices.
  void add_block() {
    ShearBlock block;
    block.slices = static_cast<std::int32_t>(active_.size());
    std::int32_t at = 0;
    for (std::size_t k = 0; k < active_.size(); ++k) {
      const ActiveSlice& active = active_[k];
      kernels_.interpolate_columns(active.columns,
                                   active.first_x,
                                   active.x_count,
                                   buffer_.data() + std::ptrdiff_t{at} * kShearColumns);
      block.origin[k] = (at - active.first_x) * kShearColumns;
      block.step[k] = static_cast<float>(256.0 * active.slice->x_of_s.per_node);
      block.low[k] = static_cast<float>(256 * active.low_x);
      block.high[k] = static_cast<float>(256 * active.high_x);
      at += active.x_count;
    }
    for (int u = 0; u < unit_.u.count; ++u) add_viewpoint(u, block);
  }

  void add_viewpoint(int u, ShearBlock& block) {
    const double u_mm = light_slab_.u.position_mm(unit_.u.begin + u);
    // Nodes whose rays meet an x between the zeros of any slice, and one more on either side.
    double first = unit_.s.end();
    double last = unit_.s.begin;
    for (std::size_t k = 0; k < active_.size(); ++k) {
      const NodeMap& map = active_[k].slice->x_of_s;
      const double start = map.start(u_mm);
      block.start[k] = static_cast<float>(256.0 * start + 0.5);
      first = std::min(first, (active_[k].low_x - start) / map.per_node - 1.0);
      last = std::max(last, (active_[k].high_x - start) / map.per_node + 1.0);
    }
    const int first_node = static_cast<int>(std::max<double>(first, unit_.s.begin));
    const int end_node = static_cast<int>(std::min<double>(last + 1.0, unit_.s.end()));
    if (first_node >= end_node) return;
    kernels_.accumulate_nodes(
        buffer_.data(), block, first_node, end_node, sums_of(u, first_node - unit_.s.begin));
  }

  std::int32_t* sums_of(int u, int s) {
    return sums_.data() + (static_cast<std::ptrdiff_t>(u) * unit_.s.count + s) * kShearColumns;
  }

  void write_samples(int v, int first_t, int t_count, bool is_empty) {
    const double v_mm = light_slab_.v.position_mm(v);
    ShearScale scale{};
    scale.attenuation_per_sum =
        static_cast<float>(volume_.grid().spacing_mm.y() * volume_.mu_per_mm_per_level() / 256.0);
    scale.quantizer_step = quantizer_.step();
    for (int position = 0; position < kShearColumns; ++position)
      scale.slope_squared_t[position] =
          slope_squared(slab_.t.position_mm(first_t + column_at(position)) - v_mm);
    std::array<std::uint16_t, kShearColumns> node{};
    for (int u = 0; u < unit_.u.count; ++u) {
      const double u_mm = light_slab_.u.position_mm(unit_.u.begin + u);
      for (int s = 0; s < unit_.s.count; ++s) {
        std::uint16_t* out =
            samples_.data() + sample_offset(u, v - unit_.v.begin, s) + (first_t - unit_.t.begin);
        if (is_empty) {
          std::fill(out, out + t_count, std::uint16_t{0});
          continue;
        }
        const float slope = slope_squared(slab_.s.position_mm(unit_.s.begin + s) - u_mm);
        const bool is_whole = t_count == kShearColumns;
        kernels_.quantize_node(sums_of(u, s), scale, slope, is_whole ? out : node.data());
        if (!is_whole) std::copy_n(node.begin(), t_count, out);
      }
    }
  }

  /// The column whose sum is at `position` of an accumulator. Of each group of eight columns, the
  /// first four are in the first half of the accumulator, the others in the second.
  static int column_at(int position) {
    const int half = position / 16;
    const int lane = position % 16;
    return lane / 4 * 8 + half * 4 + lane % 4;
  }

  [[nodiscard]] float slope_squared(double sideways_mm) const {
    const double slope = sideways_mm / plane_distance_mm_;
    return static_cast<float>(slope * slope);
  }

  [[nodiscard]] std::ptrdiff_t sample_offset(int u, int v, int s) const {
    return ((static_cast<std::ptrdiff_t>(u) * unit_.v.count + v) * unit_.s.count + s) *
           unit_.t.count;
  }

  const SlabAlignedVolume& volume_;
  const LightSlab& light_slab_;
  const SlabGeometry& slab_;
  const AttenuationQuantizer& quantizer_;
  const WorkUnit& unit_;
  std::span<std::uint16_t> samples_;
  double plane_distance_mm_;
  Kernels kernels_;
  std::vector<Slice> slices_;
  std::vector<ActiveSlice> active_;
  std::vector<std::int16_t> buffer_;  ///< first pass: rows of the active slices
  std::vector<std::int32_t> sums_;    ///< second pass: [u][s][kShearColumns] of the unit
};

}  // namespace

ShearWarpFieldCaster::ShearWarpFieldCaster(const SlabAlignedVolume& volume,
                                           const LightSlab& light_slab,
                                           const AttenuationQuantizer& quantizer)
    : volume_(volume), light_slab_(light_slab), quantizer_(quantizer) {}

void ShearWarpFieldCaster::cast(const WorkUnit& unit, std::span<std::uint16_t> samples) const {
  check(samples.size() == unit.sample_count(), "one sample per node of the unit");
  UnitCast(volume_, light_slab_, quantizer_, unit, samples).run();
}

}  // namespace af
