// SPDX-License-Identifier: Apache-2.0
#include "precompute/slab_aligned_volume.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>

#include "base/error.h"
#include "base/vector_width.h"
#include "precompute/shear_warp_kernel.h"

namespace af {

namespace {

constexpr int kLanes = 16;

/// Affine map from slab points to voxel indices.
struct IndexFromSlab {
  Eigen::Matrix3d linear;
  Eigen::Vector3d offset;

  IndexFromSlab(const CtGrid& grid, const RigidTransform& slab_from_ct) {
    const RigidTransform ct_from_slab = slab_from_ct.inverse();
    linear = grid.spacing_mm.cwiseInverse().asDiagonal() * grid.direction.transpose() *
             ct_from_slab.linear();
    offset = grid.index_of(ct_from_slab.translation());
  }
};

/// Per slab axis: true unless it runs along a voxel axis up to a shift of a few hundredths of a
/// voxel over the volume.
std::array<bool, 3> resampled_axes(const CtGrid& grid, const RigidTransform& slab_from_ct) {
  constexpr double kLargestSine = 1e-4;
  const Eigen::Matrix3d slab_axes_in_voxels =
      (grid.direction.transpose() * slab_from_ct.linear().transpose()).cwiseAbs();
  std::array<bool, 3> is_resampled{};
  for (int axis = 0; axis < 3; ++axis) {
    Eigen::Vector3d sines = slab_axes_in_voxels.col(axis);
    Eigen::Index main_axis = 0;
    sines.maxCoeff(&main_axis);
    sines[main_axis] = 0.0;
    is_resampled[static_cast<std::size_t>(axis)] = sines.maxCoeff() > kLargestSine;
  }
  return is_resampled;
}

Eigen::Vector3d resampled_spacing(const CtGrid& grid,
                                  const RigidTransform& slab_from_ct,
                                  const SlabAlignedOptions& options) {
  const Eigen::Matrix3d index_from_slab = IndexFromSlab(grid, slab_from_ct).linear;
  Eigen::Vector3d spacing_mm;
  for (int axis = 0; axis < 3; ++axis) spacing_mm[axis] = 1.0 / index_from_slab.col(axis).norm();
  const double voxel_mm = std::min(spacing_mm.x(), spacing_mm.z());
  const std::array<bool, 3> is_resampled = resampled_axes(grid, slab_from_ct);
  if (is_resampled[0]) spacing_mm.x() *= options.relative_spacing;
  if (is_resampled[2]) spacing_mm.z() *= options.relative_spacing;
  // Voxels that are tilted every way have less room between what a slice must keep and what it
  // must suppress (SliceSampler).
  constexpr double kTiltedSpacing = 0.8;
  if (is_resampled[0] && is_resampled[1] && is_resampled[2]) spacing_mm.y() *= kTiltedSpacing;
  // From slice to slice a ray moves sideways by up to its slope times their distance; between
  // slices it is taken to change linearly, which needs that move to stay within a voxel.
  constexpr double kLargestRatio = 1.25;
  spacing_mm.y() /= std::ceil(spacing_mm.y() / (kLargestRatio * voxel_mm));
  return spacing_mm;
}

/// What the filters' taps add up to in magnitude: of slices (SliceSampler), of nodes along x and z
/// (SliceSharpener).
double filter_gain(const SlabAlignedGrid& grid) {
  constexpr double kSliceGain = 36.0 / 32.0;
  constexpr double kNodeGain = 272.0 / 180.0;
  return (grid.is_resampled[0] ? kNodeGain : 1.0) * (grid.is_resampled[1] ? kSliceGain : 1.0) *
         (grid.is_resampled[2] ? kNodeGain : 1.0);
}

float scaled_levels(const AttenuationVolume& volume, const SlabAlignedGrid& grid) {
  // A column of largest levels, one per slice, each times 256, still fits in 31 bits.
  const int largest_level = std::min(std::numeric_limits<std::int16_t>::max() + 0,
                                     std::numeric_limits<std::int32_t>::max() / 256 / grid.size[1]);
  // Rounding to an integer undoes the multiplication by mu.
  const double largest_unit =
      std::round(volume.max_mu_per_mm() / volume.model().mu_per_mm_per_unit());
  // Two levels are left for rounding.
  return static_cast<float>((largest_level - 2) / (filter_gain(grid) * largest_unit));
}

/// Slices before they are sharpened: rows [z][x] of one slice, single-precision positions.
class SliceSampler {
 public:
  SliceSampler(const AttenuationVolume& volume,
               const RigidTransform& slab_from_ct,
               const SlabAlignedGrid& grid)
      : grid_(grid),
        index_from_slab_(volume.grid(), slab_from_ct),
        size_(volume.grid().size),
        voxels_{volume.voxels().data(), {size_[0], size_[1], size_[2]}},
        plane_(grid.is_resampled[1] ? grid.slice_offset(1) : 0),
        sums_(plane_.size()) {
    row_.scale = grid.levels_per_unit;
    for (int axis = 0; axis < 3; ++axis)
      row_.step[axis] = static_cast<float>(index_from_slab_.linear(axis, 0) * grid.spacing_mm.x());
  }

  /// Levels of slice y; exactly 0 on the grid's faces, whatever single precision makes of them.
  void sample(int y, std::int16_t* levels) {
    if (y == 0 || y == grid_.size[1] - 1)
      std::fill_n(levels, grid_.slice_offset(1), std::int16_t{0});
    else if (grid_.is_resampled[1])
      sample_mean(y, levels);
    else
      sample_plane(y, 0.0, levels);
  }

 private:
  struct Tap {
    double cells;
    std::int32_t weight;  ///< in 1/32
  };

  /// A sum over slices is their integral but for what oscillates once (or more often) from slice to
  /// slice. Voxels that lie oblique to the slices do: an interpolant's cells keep some per cent of
  /// the texture at that frequency. The half-band filter [-1 0 9 16 9 0 -1] / 32 at steps of half a
  /// slice is 0 there in fourth order, and 1 for the slow changes along y that slanted rays see, in
  /// fourth order too.
  void sample_mean(int y, std::int16_t* levels) {
    constexpr std::array<Tap, 5> kTaps = {{{0.0, 16}, {-0.5, 9}, {0.5, 9}, {-1.5, -1}, {1.5, -1}}};
    constexpr int kWeightBits = 5;
    std::fill(sums_.begin(), sums_.end(), 1 << (kWeightBits - 1));
    for (const Tap& tap : kTaps) {
      sample_plane(y, tap.cells, plane_.data());
      for (std::size_t i = 0; i < sums_.size(); ++i) sums_[i] += tap.weight * plane_[i];
    }
    for (std::size_t i = 0; i < sums_.size(); ++i)
      levels[i] = static_cast<std::int16_t>(sums_[i] >> kWeightBits);
  }

  /// The nodes of slice y, moved along y by `cells`.
  void sample_plane(int y, double cells, std::int16_t* levels) {
    const Eigen::Vector3d origin =
        grid_.slice_origin_mm(y) + Eigen::Vector3d(0.0, grid_.spacing_mm.y() * cells, 0.0);
    for (int z = 0; z < grid_.size[2]; ++z, levels += grid_.row_stride) {
      std::fill_n(levels, grid_.row_stride, std::int16_t{0});
      if (z == 0 || z == grid_.size[2] - 1) continue;
      sample_row(index_from_slab_.offset +
                     index_from_slab_.linear *
                         (origin + Eigen::Vector3d(0.0, 0.0, grid_.spacing_mm.z() * z)),
                 levels);
    }
  }

  /// Samples only the vectors of nodes that can lie inside the volume.
  void sample_row(const Eigen::Vector3d& start, std::int16_t* levels) {
    const Eigen::Vector3d step = index_from_slab_.linear.col(0) * grid_.spacing_mm.x();
    double first = 0.0;
    double last = grid_.size[0] - 1.0;
    for (int axis = 0; axis < 3; ++axis) {
      const double end = size_[static_cast<std::size_t>(axis)] - 1.0;
      constexpr double kParallel = 1e-9;
      if (std::abs(step[axis]) < kParallel) continue;
      const double low = -start[axis] / step[axis];
      const double high = (end - start[axis]) / step[axis];
      first = std::max(first, std::min(low, high));
      last = std::min(last, std::max(low, high));
    }
    if (first > last) return;
    const int begin = static_cast<int>(first) / kLanes * kLanes;
    const Eigen::Vector3d begin_at = start + begin * step;
    for (int axis = 0; axis < 3; ++axis) row_.start[axis] = static_cast<float>(begin_at[axis]);
    row_.count = static_cast<int>(last) + 1 - begin;
    resample_row_(voxels_, row_, levels + begin);
    levels[0] = 0;
    std::fill(levels + grid_.size[0] - 1, levels + grid_.row_stride, std::int16_t{0});
  }

  const SlabAlignedGrid& grid_;
  IndexFromSlab index_from_slab_;
  std::array<int, 3> size_;
  ResampledVolume voxels_;
  ResampledRow row_{};
  std::vector<std::int16_t> plane_;
  std::vector<std::int32_t> sums_;
  shear_warp::ResampleRow resample_row_ = select_kernel<shear_warp::ResampleRow>(
      kernels_128::resample_row, kernels_256::resample_row, kernels_512::resample_row);
};

/// Interpolating between samples linearly smooths: averaged over the positions of the nodes it is a
/// convolution with a hat, whose transform is sinc^2 = 1 - w^2/12 + w^4/360 - ... The filter
/// [2 -23 222 -23 2] / 180 has the inverse series up to w^4, so that the two together smooth only
/// in sixth order. It acts along resampled axes alone. Faces stay 0.
class SliceSharpener {
 public:
  explicit SliceSharpener(const SlabAlignedGrid& grid)
      : grid_(grid), row_(static_cast<std::size_t>(grid.row_stride)) {}

  void sharpen(const std::int16_t* levels, std::int16_t* sharpened) {
    const int reach = grid_.is_resampled[2] ? kReach : 0;
    for (int z = 0; z < grid_.size[2]; ++z) {
      const std::ptrdiff_t offset = std::ptrdiff_t{z} * grid_.row_stride;
      if (z < reach || z >= grid_.size[2] - reach)
        std::fill_n(sharpened + offset, grid_.row_stride, std::int16_t{0});
      else
        sharpen_row(levels + offset, sharpened + offset);
    }
  }

  static constexpr int kReach = 2;  ///< nodes on either side

 private:
  template <typename Level>
  static std::int32_t filtered(const Level* level, std::ptrdiff_t step) {
    return 222 * level[0] - 23 * (level[-step] + level[step]) +
           2 * (level[-2 * step] + level[2 * step]);
  }

  void sharpen_row(const std::int16_t* levels, std::int16_t* sharpened) {
    const int stride = grid_.row_stride;
    constexpr std::int32_t kUnity = 180;
    // Filtered twice, levels reach 2^15 * 180^2 at most: scaled_levels() sees to it.
    std::int32_t* along_z = row_.data();
    if (grid_.is_resampled[2])
      for (int x = 0; x < stride; ++x) along_z[x] = filtered(levels + x, stride);
    else
      for (int x = 0; x < stride; ++x) along_z[x] = kUnity * levels[x];
    const int reach = grid_.is_resampled[0] ? kReach : 0;
    constexpr float kNormalization = 1.0f / (kUnity * kUnity);
    for (int x = reach; x < grid_.size[0] - reach; ++x) {
      const auto sum = static_cast<float>(grid_.is_resampled[0] ? filtered(along_z + x, 1)
                                                                : kUnity * along_z[x]);
      // Rounds half away from zero.
      const float half = sum < 0.0f ? -0.5f : 0.5f;
      const auto level = static_cast<std::int16_t>(sum * kNormalization + half);
      // No attenuation where there was none: what rays beside the volume sum up stays below 0.
      sharpened[x] = levels[x] <= 0 ? std::min(level, std::int16_t{0}) : level;
    }
    std::fill_n(sharpened, reach, std::int16_t{0});
    std::fill(sharpened + grid_.size[0] - reach, sharpened + stride, std::int16_t{0});
  }

  const SlabAlignedGrid& grid_;
  std::vector<std::int32_t> row_;
};

SlabAlignedGrid grid_of_spacing(const AttenuationVolume& volume,
                                const RigidTransform& slab_from_ct,
                                const Eigen::Vector3d& spacing_mm) {
  SlabAlignedGrid grid;
  grid.spacing_mm = spacing_mm;
  grid.is_resampled = resampled_axes(volume.grid(), slab_from_ct);
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  grid.origin_mm = Eigen::Vector3d::Constant(kInfinity);
  Eigen::Vector3d last_mm = Eigen::Vector3d::Constant(-kInfinity);
  for (const Eigen::Vector3d& corner : volume.corner_points()) {
    grid.origin_mm = grid.origin_mm.cwiseMin(slab_from_ct * corner);
    last_mm = last_mm.cwiseMax(slab_from_ct * corner);
  }
  if (!grid.is_resampled[1]) {
    // Between the CT's planes attenuation changes linearly, so a slanted ray smears each plane by a
    // hat over its sideways way to the next ones, of variance 1/6 in units of that way. One slice
    // per plane and on it smears nothing; slices beside it by d smear by d (1 - d): 1/6 for this d.
    constexpr double kSliceShift = 0.21132486540518713;
    grid.origin_mm.y() -= kSliceShift * grid.spacing_mm.y();
  }
  for (int axis = 0; axis < 3; ++axis) {
    if (!grid.is_resampled[static_cast<std::size_t>(axis)]) continue;
    // Filters leave a fringe around the volume, and slices shift by up to one cell.
    grid.origin_mm[axis] -= (SliceSharpener::kReach + 1.0) * grid.spacing_mm[axis];
    last_mm[axis] += SliceSharpener::kReach * grid.spacing_mm[axis];
  }
  for (int axis = 0; axis < 3; ++axis) {
    // Rounding must not cost a node: attenuation within 1e-6 of a cell of the border is next to 0.
    const double cells =
        std::ceil((last_mm[axis] - grid.origin_mm[axis]) / grid.spacing_mm[axis] - 1e-6);
    constexpr double kMostCells = 32000.0;
    if (!(cells <= kMostCells)) {
      std::ostringstream text;
      text << "the CT needs " << cells << " nodes of " << grid.spacing_mm[axis]
           << " mm along one axis of the field: more than " << kMostCells;
      throw InputError(text.str());
    }
    grid.size[static_cast<std::size_t>(axis)] = static_cast<int>(cells) + 1;
  }
  grid.row_stride = (grid.size[0] + kLanes - 1) / kLanes * kLanes;
  grid.levels_per_unit = scaled_levels(volume, grid);
  return grid;
}

OccupiedRange occupied_range(std::span<const std::int16_t> row) {
  const auto is_occupied = [](std::int16_t level) { return level != 0; };
  const auto first = std::find_if(row.begin(), row.end(), is_occupied);
  if (first == row.end()) return {};
  const auto last = std::find_if(row.rbegin(), row.rend(), is_occupied);
  return {static_cast<std::int16_t>(first - row.begin()),
          static_cast<std::int16_t>(row.rend() - last)};
}

}  // namespace

std::vector<std::string> problems(const SlabAlignedOptions& options) {
  if (options.relative_spacing >= 0.1 && options.relative_spacing <= 1.0) return {};
  return {"relative_spacing = " + std::to_string(options.relative_spacing) +
          ": must be within 0.1 and 1"};
}

Eigen::Vector3d SlabAlignedGrid::slice_origin_mm(int slice) const {
  Eigen::Vector3d cells(0.0, slice, 0.0);
  // Two-dimensional golden ratio: the most evenly spread sequence of this kind.
  const double x = 0.7548776662466927 * slice;
  const double z = 0.5698402909980532 * slice;
  if (is_resampled[0]) cells.x() = x - std::floor(x);
  if (is_resampled[2]) cells.z() = z - std::floor(z);
  return origin_mm + spacing_mm.cwiseProduct(cells);
}

std::array<int, 2> SlabAlignedGrid::slice_range(double y_low_mm, double y_high_mm) const {
  int first = 0;
  while (first < size[1] && slice_y_mm(first) < y_low_mm) ++first;
  int end = first;
  while (end < size[1] && slice_y_mm(end) < y_high_mm) ++end;
  return {first, end};
}

SlabAlignedGrid slab_aligned_grid(const AttenuationVolume& volume,
                                  const RigidTransform& slab_from_ct,
                                  const SlabAlignedOptions& options) {
  throw_if_any(problems(options));
  SlabAlignedOptions coarser = options;
  SlabAlignedGrid grid = grid_of_spacing(
      volume, slab_from_ct, resampled_spacing(volume.grid(), slab_from_ct, coarser));
  constexpr double kCoarsening = 1.05;
  while (grid.is_oblique() && grid.value_count() * sizeof(std::int16_t) > options.largest_bytes &&
         coarser.relative_spacing < 1.0) {
    coarser.relative_spacing *= kCoarsening;
    grid = grid_of_spacing(
        volume, slab_from_ct, resampled_spacing(volume.grid(), slab_from_ct, coarser));
  }
  return grid;
}

void fill_slices(const AttenuationVolume& volume,
                 const RigidTransform& slab_from_ct,
                 const SlabAlignedGrid& grid,
                 int first_slice,
                 int end_slice,
                 std::span<std::int16_t> values,
                 std::span<OccupiedRange> occupied) {
  const auto z_rows = static_cast<std::size_t>(grid.size[2]);
  const auto slices = static_cast<std::size_t>(end_slice - first_slice);
  check(values.size() >= grid.slice_offset(end_slice) - grid.slice_offset(first_slice) &&
            occupied.size() == slices * z_rows,
        "room for the rows of the slices");
  const std::size_t slice_values = grid.slice_offset(1);
  SliceSampler sampler(volume, slab_from_ct, grid);
  SliceSharpener sharpener(grid);
  std::vector<std::int16_t> unsharpened(grid.is_oblique() ? slice_values : 0);
  for (int y = first_slice; y < end_slice; ++y) {
    const auto piece = static_cast<std::size_t>(y - first_slice);
    std::int16_t* slice = values.data() + piece * slice_values;
    sampler.sample(y, grid.is_oblique() ? unsharpened.data() : slice);
    if (grid.is_oblique()) sharpener.sharpen(unsharpened.data(), slice);
    for (std::size_t z = 0; z < z_rows; ++z)
      occupied[piece * z_rows + z] =
          occupied_range({slice + z * static_cast<std::size_t>(grid.row_stride),
                          static_cast<std::size_t>(grid.size[0])});
  }
}

SlabAlignedVolume::SlabAlignedVolume(const AttenuationVolume& volume,
                                     const RigidTransform& slab_from_ct,
                                     const SlabAlignedOptions& options)
    : grid_(slab_aligned_grid(volume, slab_from_ct, options)),
      mu_per_mm_per_level_(volume.model().mu_per_mm_per_unit() /
                           static_cast<double>(grid_.levels_per_unit)) {
  std::vector<std::int16_t> values(grid_.value_count());
  std::vector<OccupiedRange> occupied(grid_.row_count());
  fill_slices(volume, slab_from_ct, grid_, 0, grid_.size[1], values, occupied);
  values_ = SharedArray<std::int16_t>(std::move(values));
  occupied_ = SharedArray<OccupiedRange>(std::move(occupied));
}

SlabAlignedVolume::SlabAlignedVolume(const SlabAlignedGrid& grid,
                                     const AttenuationModel& model,
                                     SharedArray<std::int16_t> values,
                                     SharedArray<OccupiedRange> occupied)
    : grid_(grid),
      mu_per_mm_per_level_(model.mu_per_mm_per_unit() / static_cast<double>(grid.levels_per_unit)),
      values_(std::move(values)),
      occupied_(std::move(occupied)) {
  check(values_.size() == grid_.value_count() && occupied_.size() == grid_.row_count(),
        "one value per node and one range per row");
}

std::vector<std::int64_t> SlabAlignedVolume::slice_sums() const {
  std::vector<std::int64_t> sums(static_cast<std::size_t>(grid_.size[1]), 0);
  for (int y = 0; y < grid_.size[1]; ++y)
    for (int z = 0; z < grid_.size[2]; ++z) {
      const std::int16_t* row = slice(y) + static_cast<std::ptrdiff_t>(z) * grid_.row_stride;
      const OccupiedRange range = occupied(y, z);
      std::int64_t sum = 0;
      for (int x = range.begin; x < range.end; ++x) sum += row[x];
      sums[static_cast<std::size_t>(y)] += sum;
    }
  return sums;
}

}  // namespace af
