// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "precompute/casting/slab_aligned_grid.h"

namespace af {

/// Resamples slices [first_slice, end_slice). `values` and `rows` are those of the whole layout;
/// rows of the slices are narrowed to their nodes that are not 0. Several ranks may fill slices;
/// the values depend neither on the rank that fills them nor on the vector width.
void fill_slices(const AttenuationVolume& volume,
                 const RigidTransform& slab_from_ct,
                 const SlabAlignedGrid& grid,
                 int first_slice,
                 int end_slice,
                 std::span<std::int16_t> values,
                 std::span<GridRow> rows);

/// A volume resampled to the slab frame: what the shear-warp caster reads. 2 bytes per stored node.
/// \test SlabAlignedVolume.HoldsMeansOfTwoVoxelsWhenAxesAgree
class SlabAlignedVolume {
 public:
  SlabAlignedVolume(const AttenuationVolume& volume,
                    const RigidTransform& slab_from_ct,
                    const SlabAlignedOptions& options = {});
  /// Values and rows that already exist (memory shared by the ranks of a node), filled by
  /// fill_slices.
  SlabAlignedVolume(const SlabAlignedGrid& grid,
                    const AttenuationModel& model,
                    SharedArray<std::int16_t> values,
                    SharedArray<GridRow> rows);

  [[nodiscard]] const SlabAlignedGrid& grid() const { return grid_; }
  /// The stored blocks of all rows.
  [[nodiscard]] const std::int16_t* values() const { return values_.data(); }
  /// A row; its begin and end are those of what is not 0.
  [[nodiscard]] const GridRow& row(int y, int z) const { return rows_[grid_.row_index(y, z)]; }
  [[nodiscard]] std::int16_t level(int x, int y, int z) const {
    const GridRow& of = row(y, z);
    return x < of.begin || x >= of.end ? std::int16_t{0} : values()[of.origin_offset() + x];
  }
  [[nodiscard]] std::size_t bytes() const {
    return values_.view().size_bytes() + rows_.view().size_bytes();
  }
  /// Attenuation (1/mm) of one level.
  [[nodiscard]] double mu_per_mm_per_level() const { return mu_per_mm_per_level_; }
  /// Sum of the levels of each slice.
  [[nodiscard]] std::vector<std::int64_t> slice_sums() const;

 private:
  SlabAlignedGrid grid_;
  double mu_per_mm_per_level_;
  SharedArray<std::int16_t> values_;
  SharedArray<GridRow> rows_;
};

}  // namespace af
