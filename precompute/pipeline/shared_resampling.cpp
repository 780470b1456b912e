// SPDX-License-Identifier: Apache-2.0
#include "precompute/pipeline/shared_resampling.h"

#include <algorithm>
#include <array>

namespace af {

SlabAlignedVolume resample_on_node(const AttenuationVolume& volume,
                                   const RigidTransform& slab_from_ct,
                                   const SlabAlignedOptions& options,
                                   const Communicator& communicator) {
  const SlabAlignedLayout layout =
      all_or_none(communicator, [&] { return slab_aligned_layout(volume, slab_from_ct, options); });
  const std::size_t value_bytes = layout.value_count * sizeof(std::int16_t);
  const auto values_in = [&](std::byte* memory) {
    return std::span(reinterpret_cast<std::int16_t*>(memory), layout.value_count);
  };
  const auto rows_in = [&](std::byte* memory) {
    return std::span(reinterpret_cast<GridRow*>(memory + value_bytes), layout.rows.size());
  };
  const auto fill = [&](std::span<std::byte> memory, int part, int parts) {
    const int begin = layout.part_begin(part, parts);
    const int end = layout.part_begin(part + 1, parts);
    const std::span<GridRow> rows = rows_in(memory.data());
    const auto [first_row, end_row] =
        std::array{layout.grid.row_index(begin, 0), layout.grid.row_index(end, 0)};
    std::copy_n(layout.rows.data() + first_row, end_row - first_row, rows.data() + first_row);
    fill_slices(volume, slab_from_ct, layout.grid, begin, end, values_in(memory.data()), rows);
  };
  const std::shared_ptr<const std::byte> memory =
      communicator.allocate_on_node_together(layout.bytes(), fill);
  auto* base = const_cast<std::byte*>(memory.get());  // only to form views of const elements
  return {layout.grid,
          volume.model(),
          SharedArray<std::int16_t>(memory, values_in(base)),
          SharedArray<GridRow>(memory, rows_in(base))};
}

}  // namespace af
