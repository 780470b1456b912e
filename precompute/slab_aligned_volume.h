// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "geometry/light_slab.h"
#include "volume/attenuation_volume.h"

namespace af {

/// How finely a volume is resampled along x and z where these are not axes of the CT.
struct SlabAlignedOptions {
  double relative_spacing = 0.5;  ///< of the CT's own spacing in that direction
  /// Coarser spacing, at most the CT's own, is taken where the grid would need more.
  std::size_t largest_bytes = std::size_t{1} << 30;
};

std::vector<std::string> problems(const SlabAlignedOptions& options);

/// A grid along the axes of the slab frame (mm): node (x, y, z) lies at origin + index * spacing.
struct SlabAlignedGrid {
  Eigen::Vector3d origin_mm = Eigen::Vector3d::Zero();
  Eigen::Vector3d spacing_mm = Eigen::Vector3d::Ones();
  std::array<int, 3> size = {0, 0, 0};  ///< x, y, z
  int row_stride = 0;                   ///< values from (x, y, z) to (x, y, z + 1): whole vectors
  float levels_per_unit = 1.0f;         ///< stored level of a relative attenuation of 1
  /// Slab axes that do not run along an axis of the CT: x and z are then sampled finely and
  /// sharpened against the smoothing by interpolation, slices along y are means over their
  /// neighbourhood.
  std::array<bool, 3> is_resampled = {false, false, false};

  [[nodiscard]] bool is_oblique() const {
    return is_resampled[0] || is_resampled[1] || is_resampled[2];
  }
  [[nodiscard]] std::size_t row_count() const {
    return static_cast<std::size_t>(size[1]) * static_cast<std::size_t>(size[2]);
  }
  /// Values of slices [0, slice).
  [[nodiscard]] std::size_t slice_offset(int slice) const {
    return static_cast<std::size_t>(slice) * static_cast<std::size_t>(size[2]) *
           static_cast<std::size_t>(row_stride);
  }
  /// Values of an array that holds all slices: vector loads may run past the last row.
  [[nodiscard]] std::size_t value_count() const { return slice_offset(size[1]) + kTailValues; }
  [[nodiscard]] double slice_y_mm(int slice) const {
    return origin_mm.y() + spacing_mm.y() * slice;
  }
  /// Node (0, y, 0) of slice y. Along resampled x and z slices are shifted against each other by
  /// parts of a cell, so that rays that run along y meet every slice at another place between its
  /// nodes and errors of interpolation cancel.
  [[nodiscard]] Eigen::Vector3d slice_origin_mm(int slice) const;
  /// Slices with y in [y_low, y_high).
  [[nodiscard]] std::array<int, 2> slice_range(double y_low_mm, double y_high_mm) const;

  static constexpr std::size_t kTailValues = 64;
};

/// The grid that holds all attenuation of `volume` and has zeros on its faces. A slab axis that
/// runs along one of the CT keeps the CT's nodes, so that nothing is interpolated twice along it:
/// all three for a camera that looks along an axis, z for one that is turned about the patient's
/// axis. Along the others the grid is finer than the CT by options.relative_spacing and slices are
/// sharpened against the second interpolation. Slices are never much farther apart than voxels.
/// Levels are scaled such that no level exceeds 32767 and no sum of 256 times one level per slice
/// exceeds 2^31 - 1: casters add in 32-bit integers.
SlabAlignedGrid slab_aligned_grid(const AttenuationVolume& volume,
                                  const RigidTransform& slab_from_ct,
                                  const SlabAlignedOptions& options = {});

/// x of the values of one row that are not 0; begin == end when all are.
struct OccupiedRange {
  std::int16_t begin = 0;
  std::int16_t end = 0;
};

/// Resamples slices [first_slice, end_slice). `values` are those of these slices alone,
/// [y][z][x] with row_stride; `occupied` has one range per row. Pieces may be filled by several
/// ranks; the values do not depend on the pieces or the vector width.
void fill_slices(const AttenuationVolume& volume,
                 const RigidTransform& slab_from_ct,
                 const SlabAlignedGrid& grid,
                 int first_slice,
                 int end_slice,
                 std::span<std::int16_t> values,
                 std::span<OccupiedRange> occupied);

/// A volume resampled to the slab frame: what the shear-warp caster reads. 2 bytes per node.
/// \test SlabAlignedVolume.HoldsMeansOfTwoVoxelsWhenAxesAgree
class SlabAlignedVolume {
 public:
  SlabAlignedVolume(const AttenuationVolume& volume,
                    const RigidTransform& slab_from_ct,
                    const SlabAlignedOptions& options = {});
  /// Values that already exist (memory shared by the ranks of a node), filled by fill_slices.
  SlabAlignedVolume(const SlabAlignedGrid& grid,
                    const AttenuationModel& model,
                    SharedArray<std::int16_t> values,
                    SharedArray<OccupiedRange> occupied);

  [[nodiscard]] const SlabAlignedGrid& grid() const { return grid_; }
  /// [z][x] of one slice.
  [[nodiscard]] const std::int16_t* slice(int y) const {
    return values_.data() + grid_.slice_offset(y);
  }
  [[nodiscard]] OccupiedRange occupied(int y, int z) const {
    return occupied_[static_cast<std::size_t>(y) * static_cast<std::size_t>(grid_.size[2]) +
                     static_cast<std::size_t>(z)];
  }
  /// Attenuation (1/mm) of one level.
  [[nodiscard]] double mu_per_mm_per_level() const { return mu_per_mm_per_level_; }
  /// Sum of the levels of each slice.
  [[nodiscard]] std::vector<std::int64_t> slice_sums() const;

 private:
  SlabAlignedGrid grid_;
  double mu_per_mm_per_level_;
  SharedArray<std::int16_t> values_;
  SharedArray<OccupiedRange> occupied_;
};

}  // namespace af
