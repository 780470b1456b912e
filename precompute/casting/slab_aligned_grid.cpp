// SPDX-License-Identifier: Apache-2.0
#include "precompute/casting/slab_aligned_grid.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>

#include "base/error.h"
#include "precompute/casting/attenuating_bricks.h"

namespace af {

namespace {

/// For each slab axis, true unless it runs along a voxel axis up to a shift of a few hundredths of
/// a voxel over the volume.
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

/// Whether no slab axis runs along an axis of the CT.
bool is_tilted(const std::array<bool, 3>& is_resampled) {
  return is_resampled[0] && is_resampled[1] && is_resampled[2];
}

Eigen::Vector3d resampled_spacing(const CtGrid& grid,
                                  const RigidTransform& slab_from_ct,
                                  double relative_spacing) {
  const Eigen::Matrix3d index_from_slab = IndexFromSlab(grid, slab_from_ct).linear;
  Eigen::Vector3d spacing_mm;
  for (int axis = 0; axis < 3; ++axis) spacing_mm[axis] = 1.0 / index_from_slab.col(axis).norm();
  const double voxel_mm = std::min(spacing_mm.x(), spacing_mm.z());
  const std::array<bool, 3> is_resampled = resampled_axes(grid, slab_from_ct);
  if (is_resampled[0]) spacing_mm.x() *= relative_spacing;
  if (is_resampled[2]) spacing_mm.z() *= relative_spacing;
  // Voxels that are tilted about every axis leave less room between the frequencies that a slice
  // must keep and those that it must suppress (RowSampler in slab_aligned_volume.cpp).
  constexpr double kTiltedSpacing = 0.8;
  if (is_tilted(is_resampled)) spacing_mm.y() *= kTiltedSpacing;
  // From slice to slice a ray moves sideways by up to its slope times their distance. Attenuation
  // is assumed to change linearly along that step, so the step must stay within about a voxel.
  constexpr double kLargestRatio = 1.25;
  spacing_mm.y() /= std::ceil(spacing_mm.y() / (kLargestRatio * voxel_mm));
  return spacing_mm;
}

/// The product of the sums of the filters' absolute taps: over slices (RowSampler), and over nodes
/// along x and z (RowSharpener).
double filter_gain(const SlabAlignedGrid& grid) {
  constexpr double kSliceGain = 36.0 / 32.0;
  constexpr double kNodeGain = 272.0 / 180.0;
  return (grid.is_resampled[0] ? kNodeGain : 1.0) * (grid.is_resampled[1] ? kSliceGain : 1.0) *
         (grid.is_resampled[2] ? kNodeGain : 1.0);
}

float scaled_levels(const AttenuationVolume& volume, const SlabAlignedGrid& grid) {
  // A column of largest levels, one per slice, each times 256, must still fit in 31 bits.
  const int largest_level = std::min(std::numeric_limits<std::int16_t>::max() + 0,
                                     std::numeric_limits<std::int32_t>::max() / 256 / grid.size[1]);
  // Rounding to an integer undoes the multiplication by mu.
  const double largest_unit =
      std::round(volume.max_mu_per_mm() / volume.model().mu_per_mm_per_unit());
  // Two levels are left for rounding.
  return static_cast<float>((largest_level - 2) / (filter_gain(grid) * largest_unit));
}

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
    // Attenuation is linear between the CT's planes, so a slanted ray smears each plane by a hat as
    // wide as its sideways step to the next planes: variance 1/6 in units of that step. A slice on
    // each plane smears nothing. Slices offset by d smear by d (1 - d), which is 1/6 for this d.
    constexpr double kSliceShift = 0.21132486540518713;
    grid.origin_mm.y() -= kSliceShift * grid.spacing_mm.y();
  }
  for (int axis = 0; axis < 3; ++axis) {
    if (!grid.is_resampled[static_cast<std::size_t>(axis)]) continue;
    // Filters leave a fringe around the volume, and slices shift by up to one cell.
    grid.origin_mm[axis] -= (kNodeFilterReach + 1.0) * grid.spacing_mm[axis];
    last_mm[axis] += kNodeFilterReach * grid.spacing_mm[axis];
  }
  for (int axis = 0; axis < 3; ++axis) {
    // Rounding must not cost a node: attenuation within 1e-6 of a cell of the border is almost 0.
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
  grid.levels_per_unit = scaled_levels(volume, grid);
  return grid;
}

/// The parts of a grid's rows that can differ from 0, found without sampling them.
class RowFinder {
 public:
  RowFinder(const AttenuationVolume& volume,
            const RigidTransform& slab_from_ct,
            const SlabAlignedGrid& grid)
      : grid_(grid),
        index_from_slab_(volume.grid(), slab_from_ct),
        reach_(reach_voxels(index_from_slab_.linear, grid)),
        bricks_(volume, reach_),
        size_(volume.grid().size) {}

  /// begin and end of row (y, z).
  [[nodiscard]] GridRow find(int y, int z) const {
    if (y == 0 || y == grid_.size[1] - 1 || z == 0 || z == grid_.size[2] - 1) return {};
    const NodeLine line = index_from_slab_.row(grid_, grid_.slice_origin_mm(y), z);
    const auto [first_inside, last_inside] = line.nodes_inside(size_, reach_, grid_.size[0]);
    if (first_inside > last_inside) return {};
    int first = static_cast<int>(first_inside) / kStep;
    int last = static_cast<int>(last_inside) / kStep;
    const auto is_near = [&](int step) {
      return bricks_.is_near(line.start + (kStep * step + (kStep - 1) / 2.0) * line.step);
    };
    while (first <= last && !is_near(first)) ++first;
    while (first < last && !is_near(last)) --last;
    if (first > last) return {};
    GridRow row;
    row.begin = static_cast<std::int16_t>(kStep * first);
    row.end = static_cast<std::int16_t>(std::min(kStep * (last + 1), grid_.size[0]));
    return row;
  }

 private:
  /// How many nodes of a row are looked at together, from the middle.
  static constexpr int kStep = 4;

  /// How far the voxels on which nodes depend lie from the middle of their step. It covers the
  /// other nodes of the step, the filters, and a cell of trilinear interpolation.
  static std::array<int, 3> reach_voxels(const Eigen::Matrix3d& index_from_slab,
                                         const SlabAlignedGrid& grid) {
    const auto filter_reach = [&](std::size_t axis, double reach) {
      return grid.is_resampled[axis] ? reach : 0.0;
    };
    const Eigen::Vector3d spacings((kStep - 1) / 2.0 + filter_reach(0, kNodeFilterReach),
                                   filter_reach(1, kSliceFilterReach),
                                   filter_reach(2, kNodeFilterReach));
    const Eigen::Vector3d voxels =
        index_from_slab.cwiseAbs() * grid.spacing_mm.cwiseProduct(spacings);
    constexpr double kCellAndRounding = 1.01;
    std::array<int, 3> reach{};
    for (int axis = 0; axis < 3; ++axis)
      reach[static_cast<std::size_t>(axis)] =
          static_cast<int>(std::ceil(voxels[axis] + kCellAndRounding));
    return reach;
  }

  const SlabAlignedGrid& grid_;
  IndexFromSlab index_from_slab_;
  std::array<int, 3> reach_;
  AttenuatingBricks bricks_;
  std::array<int, 3> size_;
};

SlabAlignedLayout layout_of(const AttenuationVolume& volume,
                            const RigidTransform& slab_from_ct,
                            const SlabAlignedGrid& grid) {
  SlabAlignedLayout layout;
  layout.grid = grid;
  layout.rows.reserve(grid.row_count());
  const RowFinder finder(volume, slab_from_ct, grid);
  std::int64_t blocks = 0;
  for (int y = 0; y < grid.size[1]; ++y)
    for (int z = 0; z < grid.size[2]; ++z) {
      GridRow row = finder.find(y, z);
      row.origin_block = static_cast<std::int32_t>(blocks - row.first_block());
      blocks += row.end_block() - row.first_block();
      check(blocks <= std::numeric_limits<std::int32_t>::max(), "fewer than 2^31 blocks of a grid");
      layout.rows.push_back(row);
    }
  layout.value_count = static_cast<std::size_t>(blocks) * kRowBlock;
  return layout;
}

std::size_t default_largest_bytes(const AttenuationVolume& volume) {
  constexpr std::size_t kSmall = std::size_t{96} << 20;
  constexpr std::size_t kBytesPerVoxel = 6;
  return std::max(kSmall, kBytesPerVoxel * volume.grid().voxel_count());
}

}  // namespace

IndexFromSlab::IndexFromSlab(const CtGrid& grid, const RigidTransform& slab_from_ct) {
  const RigidTransform ct_from_slab = slab_from_ct.inverse();
  linear = grid.spacing_mm.cwiseInverse().asDiagonal() * grid.direction.transpose() *
           ct_from_slab.linear();
  offset = grid.index_of(ct_from_slab.translation());
}

NodeLine IndexFromSlab::row(const SlabAlignedGrid& grid,
                            const Eigen::Vector3d& slice_origin_mm,
                            int z) const {
  const Eigen::Vector3d first_mm =
      slice_origin_mm + Eigen::Vector3d(0.0, 0.0, grid.spacing_mm.z() * z);
  return {offset + linear * first_mm, linear.col(0) * grid.spacing_mm.x()};
}

std::array<double, 2> NodeLine::nodes_inside(const std::array<int, 3>& size,
                                             const std::array<int, 3>& margin,
                                             int nodes) const {
  double first = 0.0;
  double last = nodes - 1.0;
  for (int axis = 0; axis < 3; ++axis) {
    const auto of_axis = static_cast<std::size_t>(axis);
    const double begin = -margin[of_axis];
    const double end = size[of_axis] - 1.0 + margin[of_axis];
    constexpr double kParallel = 1e-9;
    if (std::abs(step[axis]) < kParallel) {
      if (start[axis] < begin - kParallel || start[axis] > end + kParallel) return {1.0, 0.0};
      continue;
    }
    const double low = (begin - start[axis]) / step[axis];
    const double high = (end - start[axis]) / step[axis];
    first = std::max(first, std::min(low, high));
    last = std::min(last, std::max(low, high));
  }
  return {first, last};
}

int SlabAlignedLayout::part_begin(int part, int parts) const {
  const auto share = static_cast<std::int64_t>(value_count / kRowBlock) * part / parts;
  int y = 0;
  const auto end_block_of = [&](int slice) {
    const GridRow& last = rows[grid.row_index(slice, grid.size[2] - 1)];
    return last.origin_block + last.end_block();
  };
  while (y < grid.size[1] && (part == parts || end_block_of(y) <= share)) ++y;
  return part == 0 ? 0 : y;
}

std::vector<std::string> problems(const SlabAlignedOptions& options) {
  std::vector<std::string> found;
  const auto check_spacing = [&](const char* name, double spacing) {
    if (!(spacing >= 0.1 && spacing <= 1.0))
      found.push_back(std::string(name) + " = " + std::to_string(spacing) +
                      ": must be between 0.1 and 1");
  };
  check_spacing("turned_spacing", options.turned_spacing);
  check_spacing("tilted_spacing", options.tilted_spacing);
  return found;
}

Eigen::Vector3d SlabAlignedGrid::slice_origin_mm(int slice) const {
  Eigen::Vector3d cells(0.0, slice, 0.0);
  // The two-dimensional golden ratio gives the most evenly spread sequence of this kind.
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

SlabAlignedLayout slab_aligned_layout(const AttenuationVolume& volume,
                                      const RigidTransform& slab_from_ct,
                                      const SlabAlignedOptions& options) {
  throw_if_any(problems(options));
  const std::size_t largest =
      options.largest_bytes > 0 ? options.largest_bytes : default_largest_bytes(volume);
  const bool tilted = is_tilted(resampled_axes(volume.grid(), slab_from_ct));
  double relative_spacing = tilted ? options.tilted_spacing : options.turned_spacing;
  while (true) {
    SlabAlignedLayout layout = layout_of(
        volume,
        slab_from_ct,
        grid_of_spacing(volume,
                        slab_from_ct,
                        resampled_spacing(volume.grid(), slab_from_ct, relative_spacing)));
    const double excess = static_cast<double>(layout.bytes()) / static_cast<double>(largest);
    if (excess <= 1.0 || !layout.grid.is_oblique() || relative_spacing >= 1.0) return layout;
    // Rows end at whole blocks, so bytes fall a little less than nodes do.
    constexpr double kLeastCoarsening = 1.02;
    relative_spacing *= std::max(kLeastCoarsening, tilted ? std::sqrt(excess) : excess);
    relative_spacing = std::min(relative_spacing, 1.0);
  }
}

}  // namespace af
