// SPDX-License-Identifier: Apache-2.0
#include "precompute/casting/slab_aligned_volume.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/vector_width.h"
#include "precompute/casting/shear_warp_kernel.h"

namespace af {

namespace {

constexpr int kLanes = 16;  ///< of resample_row: rows are whole vectors of this many

/// Samples rows of slices, which are not sharpened yet. Positions have single precision.
class RowSampler {
 public:
  RowSampler(const AttenuationVolume& volume,
             const RigidTransform& slab_from_ct,
             const SlabAlignedGrid& grid)
      : grid_(grid),
        index_from_slab_(volume.grid(), slab_from_ct),
        size_(volume.grid().size),
        voxels_{volume.voxels().data(), {size_[0], size_[1], size_[2]}},
        tap_(row_stride(grid)),
        sums_(row_stride(grid)) {
    kernel_row_.scale = grid.levels_per_unit;
    const Eigen::Vector3d step = index_from_slab_.linear.col(0) * grid.spacing_mm.x();
    for (int axis = 0; axis < 3; ++axis) kernel_row_.step[axis] = static_cast<float>(step[axis]);
  }

  /// Values of a row: whole blocks.
  static std::size_t row_stride(const SlabAlignedGrid& grid) {
    return static_cast<std::size_t>((grid.size[0] + kRowBlock - 1) / kRowBlock) * kRowBlock;
  }

  /// Levels of one row, 0 outside the nodes of `row`. They are exactly 0 on the grid's faces,
  /// whatever single precision makes of them.
  void sample(int y, int z, const GridRow& row, std::int16_t* levels) {
    std::fill_n(levels, row_stride(grid_), std::int16_t{0});
    if (row.begin == row.end) return;
    if (grid_.is_resampled[1])
      sample_mean(y, z, row, levels);
    else
      sample_nodes(y, z, 0.0, row, levels);
    levels[0] = 0;
    std::fill(levels + grid_.size[0] - 1, levels + row_stride(grid_), std::int16_t{0});
  }

 private:
  struct Tap {
    double cells;
    std::int32_t weight;  ///< in 1/32
  };

  /// A sum over slices equals their integral, except for content that oscillates once or more per
  /// slice. Voxels oblique to the slices have such content: interpolation keeps a few per cent of
  /// the texture at that frequency. The half-band filter [-1 0 9 16 9 0 -1] / 32 at steps of half a
  /// slice is 0 there to fourth order. It is 1 to fourth order for the slow changes along y that
  /// slanted rays see.
  void sample_mean(int y, int z, const GridRow& row, std::int16_t* levels) {
    constexpr std::array<Tap, 5> kTaps = {
        {{0.0, 16}, {-0.5, 9}, {0.5, 9}, {-kSliceFilterReach, -1}, {kSliceFilterReach, -1}}};
    constexpr int kWeightBits = 5;
    std::fill(sums_.begin() + row.begin, sums_.begin() + row.end, 1 << (kWeightBits - 1));
    for (const Tap& tap : kTaps) {
      std::fill(tap_.begin() + row.begin, tap_.begin() + row.end, std::int16_t{0});
      sample_nodes(y, z, tap.cells, row, tap_.data());
      for (auto x = static_cast<std::size_t>(row.begin); x < static_cast<std::size_t>(row.end); ++x)
        sums_[x] += tap.weight * tap_[x];
    }
    for (auto x = static_cast<std::size_t>(row.begin); x < static_cast<std::size_t>(row.end); ++x)
      levels[x] = static_cast<std::int16_t>(sums_[x] >> kWeightBits);
  }

  /// The nodes of a row, moved along y by `cells`: only the vectors that hold nodes of `row` inside
  /// the volume. Positions are counted from the first node inside, whatever `row` is.
  void sample_nodes(int y, int z, double cells, const GridRow& row, std::int16_t* levels) {
    const Eigen::Vector3d moved(0.0, grid_.spacing_mm.y() * cells, 0.0);
    const NodeLine line = index_from_slab_.row(grid_, grid_.slice_origin_mm(y) + moved, z);
    const auto [first, last] = line.nodes_inside(size_, {0, 0, 0}, grid_.size[0]);
    if (first > last) return;
    const int counted_from = static_cast<int>(first) / kLanes * kLanes;
    const int begin = std::max(counted_from, row.begin / kLanes * kLanes);
    const int end = std::min(static_cast<int>(last) + 1, int{row.end});
    if (begin >= end) return;
    const Eigen::Vector3d start = line.start + counted_from * line.step;
    for (int axis = 0; axis < 3; ++axis) kernel_row_.start[axis] = static_cast<float>(start[axis]);
    kernel_row_.first = begin - counted_from;
    kernel_row_.count = end - begin;
    resample_row_(voxels_, kernel_row_, levels + begin);
  }

  const SlabAlignedGrid& grid_;
  IndexFromSlab index_from_slab_;
  std::array<int, 3> size_;
  VoxelsToResample voxels_;
  RowToResample kernel_row_{};
  std::vector<std::int16_t> tap_;
  std::vector<std::int32_t> sums_;
  shear_warp::ResampleRow resample_row_ = select_kernel<shear_warp::ResampleRow>(
      kernels_128::resample_row, kernels_256::resample_row, kernels_512::resample_row);
};

/// Linear interpolation between samples smooths. Averaged over the positions of the nodes, it is a
/// convolution with a hat, whose transform is sinc^2 = 1 - w^2/12 + w^4/360 - ... The filter [2 -23
/// 222 -23 2] / 180 has the inverse series up to w^4, so that both together smooth only in sixth
/// order. It acts along resampled axes alone. Faces stay 0.
class RowSharpener {
 public:
  explicit RowSharpener(const SlabAlignedGrid& grid)
      : grid_(grid), stride_(RowSampler::row_stride(grid)), along_z_(stride_) {}

  /// Sharpens nodes [begin, end) of row z. `slice` holds all its rows, and `sharpened` points to x
  /// = 0.
  void sharpen(const std::int16_t* slice, int z, int begin, int end, std::int16_t* sharpened) {
    const int reach_x = grid_.is_resampled[0] ? kNodeFilterReach : 0;
    const int reach_z = grid_.is_resampled[2] ? kNodeFilterReach : 0;
    std::fill(sharpened + begin, sharpened + end, std::int16_t{0});
    if (z < reach_z || z >= grid_.size[2] - reach_z) return;
    const std::int16_t* levels = slice + z * static_cast<std::ptrdiff_t>(stride_);
    begin = std::max(begin, reach_x);
    end = std::min(end, grid_.size[0] - reach_x);
    filter_along_z(levels, begin - reach_x, end + reach_x);
    constexpr float kNormalization = 1.0f / (kUnity * kUnity);
    for (int x = begin; x < end; ++x) {
      const std::int32_t* at = along_z_.data() + x;
      const auto sum = static_cast<float>(reach_x > 0 ? filtered(at, 1) : kUnity * *at);
      // This rounds half away from zero.
      const float half = sum < 0.0f ? -0.5f : 0.5f;
      const auto level = static_cast<std::int16_t>(sum * kNormalization + half);
      // A node that did not attenuate must not attenuate now, so that the sums of rays beside the
      // volume do not rise above 0.
      sharpened[x] = levels[x] <= 0 ? std::min(level, std::int16_t{0}) : level;
    }
  }

 private:
  static constexpr std::int32_t kUnity = 180;

  template <typename Level>
  static std::int32_t filtered(const Level* level, std::ptrdiff_t step) {
    return 222 * level[0] - 23 * (level[-step] + level[step]) +
           2 * (level[-2 * step] + level[2 * step]);
  }

  /// Levels that are filtered twice reach at most 2^15 * 180^2, which scaled_levels() ensures.
  void filter_along_z(const std::int16_t* levels, int begin, int end) {
    const auto stride = static_cast<std::ptrdiff_t>(stride_);
    std::int32_t* out = along_z_.data();
    if (grid_.is_resampled[2])
      for (int x = begin; x < end; ++x) out[x] = filtered(levels + x, stride);
    else
      for (int x = begin; x < end; ++x) out[x] = kUnity * levels[x];
  }

  const SlabAlignedGrid& grid_;
  std::size_t stride_;
  std::vector<std::int32_t> along_z_;
};

/// Narrows a row to its nodes that are not 0.
void narrow(GridRow& row, const std::int16_t* values) {
  const std::int16_t* levels = values + row.origin_offset();
  while (row.begin < row.end && levels[row.begin] == 0) ++row.begin;
  while (row.begin < row.end && levels[row.end - 1] == 0) --row.end;
  if (row.begin == row.end) row.begin = row.end = 0;
}

/// Resamples a part of the slices. `values` and `rows` are those of the whole layout. Rows of the
/// slices are narrowed to their nodes that are not 0.
void fill_slices(const AttenuationVolume& volume,
                 const RigidTransform& slab_from_ct,
                 const SlabAlignedLayout& layout,
                 int first_slice,
                 int end_slice,
                 std::span<std::int16_t> values,
                 std::span<GridRow> rows) {
  const SlabAlignedGrid& grid = layout.grid;
  const std::size_t first_row = grid.row_index(first_slice, 0);
  std::copy_n(layout.rows.data() + first_row,
              grid.row_index(end_slice, 0) - first_row,
              rows.data() + first_row);
  const std::size_t stride = RowSampler::row_stride(grid);
  RowSampler sampler(volume, slab_from_ct, grid);
  RowSharpener sharpener(grid);
  std::vector<std::int16_t> slice(stride * static_cast<std::size_t>(grid.size[2]));
  for (int y = first_slice; y < end_slice; ++y) {
    GridRow* const rows_of_slice = rows.data() + grid.row_index(y, 0);
    for (int z = 0; z < grid.size[2]; ++z)
      sampler.sample(y, z, rows_of_slice[z], slice.data() + static_cast<std::size_t>(z) * stride);
    for (int z = 0; z < grid.size[2]; ++z) {
      GridRow& row = rows_of_slice[z];
      const int begin = kRowBlock * row.first_block();
      const int end = kRowBlock * row.end_block();
      std::int16_t* const levels = values.data() + row.origin_offset();
      const std::int16_t* const sampled = slice.data() + static_cast<std::size_t>(z) * stride;
      if (grid.is_oblique())
        sharpener.sharpen(slice.data(), z, begin, end, levels);
      else
        std::copy(sampled + begin, sampled + end, levels + begin);
      narrow(row, values.data());
    }
  }
}

std::shared_ptr<const std::byte> filled_in_process(std::size_t bytes, const SlabAlignedFill& fill) {
  const std::shared_ptr<std::byte[]> memory = std::make_unique_for_overwrite<std::byte[]>(bytes);
  fill({memory.get(), bytes}, 0, 1);
  return {memory, memory.get()};
}

}  // namespace

SlabAlignedVolume::SlabAlignedVolume(const AttenuationVolume& volume,
                                     const RigidTransform& slab_from_ct,
                                     const SlabAlignedOptions& options)
    : SlabAlignedVolume(volume,
                        slab_from_ct,
                        slab_aligned_layout(volume, slab_from_ct, options),
                        filled_in_process) {}

SlabAlignedVolume::SlabAlignedVolume(const AttenuationVolume& volume,
                                     const RigidTransform& slab_from_ct,
                                     const SlabAlignedLayout& layout,
                                     const SlabAlignedMemory& memory)
    : grid_(layout.grid),
      mu_per_mm_per_level_(volume.model().mu_per_mm_per_unit() /
                           static_cast<double>(grid_.levels_per_unit)) {
  check(layout.rows.size() == grid_.row_count(), "a row of the layout for each row of the grid");
  const auto values_in = [&](std::byte* bytes) {
    return std::span(reinterpret_cast<std::int16_t*>(bytes), layout.value_count);
  };
  const auto rows_in = [&](std::byte* bytes) {
    std::byte* const behind_values = bytes + layout.value_count * sizeof(std::int16_t);
    return std::span(reinterpret_cast<GridRow*>(behind_values), layout.rows.size());
  };
  const auto fill = [&](std::span<std::byte> bytes, int part, int parts) {
    fill_slices(volume,
                slab_from_ct,
                layout,
                layout.part_begin(part, parts),
                layout.part_begin(part + 1, parts),
                values_in(bytes.data()),
                rows_in(bytes.data()));
  };
  const std::shared_ptr<const std::byte> owner = memory(layout.bytes(), fill);
  auto* base = const_cast<std::byte*>(owner.get());  // only to form views of const elements
  values_ = SharedArray<std::int16_t>(owner, values_in(base));
  rows_ = SharedArray<GridRow>(owner, rows_in(base));
}

std::vector<std::int64_t> SlabAlignedVolume::slice_sums() const {
  std::vector<std::int64_t> sums(static_cast<std::size_t>(grid_.size[1]), 0);
  for (int y = 0; y < grid_.size[1]; ++y)
    for (int z = 0; z < grid_.size[2]; ++z) {
      const GridRow& stored = row(y, z);
      const std::int16_t* levels = values() + stored.origin_offset();
      std::int64_t sum = 0;
      for (int x = stored.begin; x < stored.end; ++x) sum += levels[x];
      sums[static_cast<std::size_t>(y)] += sum;
    }
  return sums;
}

}  // namespace af
