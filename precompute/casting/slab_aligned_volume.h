// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "precompute/casting/slab_aligned_grid.h"

namespace af {

/// Fills a part of a resampled volume's memory. Parts may be filled concurrently.
using SlabAlignedFill = std::function<void(std::span<std::byte> memory, int part, int parts)>;

/// Provides memory of `bytes` bytes and has it filled: by one call (memory, 0, 1), or by the ranks
/// of a node together (Communicator::allocate_on_node_together).
using SlabAlignedMemory =
    std::function<std::shared_ptr<const std::byte>(std::size_t bytes, const SlabAlignedFill& fill)>;

/// A volume resampled to the slab frame, as the shear-warp caster reads it. Takes 2 bytes per
/// stored node. \test SlabAlignedVolume.HoldsMeansOfTwoVoxelsWhenAxesAgree
class SlabAlignedVolume {
 public:
  /// Lies in memory of this process.
  SlabAlignedVolume(const AttenuationVolume& volume,
                    const RigidTransform& slab_from_ct,
                    const SlabAlignedOptions& options = {});
  /// Laid out by `layout`, from slab_aligned_layout(), in memory from `memory`. The values depend
  /// neither on who fills which part nor on the vector width.
  SlabAlignedVolume(const AttenuationVolume& volume,
                    const RigidTransform& slab_from_ct,
                    const SlabAlignedLayout& layout,
                    const SlabAlignedMemory& memory);

  [[nodiscard]] const SlabAlignedGrid& grid() const { return grid_; }
  /// The stored blocks of all rows.
  [[nodiscard]] const std::int16_t* values() const { return values_.data(); }
  /// A row. Its begin and end bound the values that are not 0.
  [[nodiscard]] const GridRow& row(int y, int z) const { return rows_[grid_.row_index(y, z)]; }
  [[nodiscard]] std::int16_t level(int x, int y, int z) const {
    const GridRow& stored = row(y, z);
    return x < stored.begin || x >= stored.end ? std::int16_t{0}
                                               : values()[stored.origin_offset() + x];
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
