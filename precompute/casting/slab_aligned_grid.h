// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "ct/attenuation_volume.h"
#include "geometry/rigid_transform.h"

namespace af {

/// Resampling spacing along x and z where these are not axes of the CT, as a fraction of the CT's
/// own spacing in that direction.
struct SlabAlignedOptions {
  double turned_spacing = 0.5;   ///< when one slab axis runs along an axis of the CT
  double tilted_spacing = 0.35;  ///< when none does
  /// If the grid would need more memory than this, its spacing is coarsened, at most to the CT's
  /// own. 0 means 6 bytes per voxel of the CT, or 96 MiB if that is more.
  std::size_t largest_bytes = 0;
};

std::vector<std::string> problems(const SlabAlignedOptions& options);

/// A grid along the axes of the slab frame (mm): node (x, y, z) lies at origin + index * spacing.
struct SlabAlignedGrid {
  Eigen::Vector3d origin_mm = Eigen::Vector3d::Zero();
  Eigen::Vector3d spacing_mm = Eigen::Vector3d::Ones();
  std::array<int, 3> size = {0, 0, 0};  ///< x, y, z
  float levels_per_unit = 1.0f;         ///< stored level of a relative attenuation of 1
  /// Slab axes that do not run along an axis of the CT. x and z are then sampled finely, and
  /// sharpened against the smoothing by interpolation. Slices along y are means over their
  /// neighbourhood.
  std::array<bool, 3> is_resampled = {false, false, false};

  [[nodiscard]] bool is_oblique() const {
    return is_resampled[0] || is_resampled[1] || is_resampled[2];
  }
  [[nodiscard]] std::size_t row_count() const { return row_index(size[1], 0); }
  [[nodiscard]] std::size_t row_index(int y, int z) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(size[2]) +
           static_cast<std::size_t>(z);
  }
  [[nodiscard]] double slice_y_mm(int slice) const {
    return origin_mm.y() + spacing_mm.y() * slice;
  }
  /// Node (0, y, 0) of slice y. Along resampled x and z, slices are shifted against each other by
  /// fractions of a cell. A ray along y then meets each slice at a different place between nodes,
  /// and interpolation errors cancel.
  [[nodiscard]] Eigen::Vector3d slice_origin_mm(int slice) const;
  /// Slices with y in [y_low, y_high).
  [[nodiscard]] std::array<int, 2> slice_range(double y_low_mm, double y_high_mm) const;
};

/// Nodes along x in continuous voxel indices: node i at start + i * step.
struct NodeLine {
  Eigen::Vector3d start;
  Eigen::Vector3d step;

  /// First and last position (in nodes) where a line of `nodes` is inside the box of `size` voxels
  /// widened by `margin`. first > last when it misses the box.
  [[nodiscard]] std::array<double, 2> nodes_inside(const std::array<int, 3>& size,
                                                   const std::array<int, 3>& margin,
                                                   int nodes) const;
};

/// Affine map from slab points (mm) to continuous voxel indices.
struct IndexFromSlab {
  IndexFromSlab(const CtGrid& grid, const RigidTransform& slab_from_ct);

  /// Row z of a slice whose node (0, 0) lies at slice_origin_mm.
  [[nodiscard]] NodeLine row(const SlabAlignedGrid& grid,
                             const Eigen::Vector3d& slice_origin_mm,
                             int z) const;

  Eigen::Matrix3d linear;
  Eigen::Vector3d offset;
};

/// Rows are stored from one multiple of this x to another: one 64-byte vector of 16-bit levels.
inline constexpr int kRowBlock = 32;
/// How far the filters of resampled axes reach: nodes along x and z, and spacings along y.
inline constexpr int kNodeFilterReach = 2;
inline constexpr double kSliceFilterReach = 1.5;

/// One row (y, z) as it is stored: levels of x in [begin, end), 0 elsewhere.
struct GridRow {
  std::int32_t origin_block = 0;  ///< block where x = 0 would be among the values; may lie before
  std::int16_t begin = 0;         ///< begin == end: nothing is stored
  std::int16_t end = 0;

  [[nodiscard]] int first_block() const { return begin / kRowBlock; }
  [[nodiscard]] int end_block() const { return (end + kRowBlock - 1) / kRowBlock; }
  /// Distance from the first value of all rows to the level of x = 0.
  [[nodiscard]] std::ptrdiff_t origin_offset() const {
    return std::ptrdiff_t{origin_block} * kRowBlock;
  }
};

/// A grid and where its rows are stored, before they are filled.
struct SlabAlignedLayout {
  SlabAlignedGrid grid;
  std::vector<GridRow> rows;  ///< [y][z]; begin and end bound what can differ from 0
  std::size_t value_count = 0;

  [[nodiscard]] std::size_t bytes() const {
    return value_count * sizeof(std::int16_t) + rows.size() * sizeof(GridRow);
  }
  /// First slice of part 0 ... parts (no part: all slices). Parts take about equally long to fill.
  [[nodiscard]] int part_begin(int part, int parts) const;
};

/// The grid that holds all attenuation of `volume`, with zeros on its faces. Of each row, only what
/// lies between the first and the last attenuation is stored.
/// A slab axis parallel to a CT axis keeps the CT's spacing, so that nothing is interpolated twice
/// along it: all three axes for a camera that looks along a CT axis, and z for a camera turned
/// about the patient's axis. (Along y, slices are offset from the CT's by a fifth of their
/// spacing.) Along other axes the grid is finer than the CT, as the options say, and slices are
/// sharpened to undo the second interpolation. Slices are never much farther apart than voxels.
/// Levels are scaled such that no level exceeds 32767, and no sum of 256 times one level per slice
/// exceeds 2^31 - 1, because casters add in 32-bit integers.
SlabAlignedLayout slab_aligned_layout(const AttenuationVolume& volume,
                                      const RigidTransform& slab_from_ct,
                                      const SlabAlignedOptions& options = {});

}  // namespace af
