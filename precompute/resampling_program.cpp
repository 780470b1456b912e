// SPDX-License-Identifier: Apache-2.0
#include "precompute/resampling_program.h"

namespace af {

SlabAlignedVolume resample_on_node(const AttenuationVolume& volume,
                                   const RigidTransform& slab_from_ct,
                                   const SlabAlignedOptions& options,
                                   const Communicator& communicator) {
  const SlabAlignedGrid grid =
      all_or_none(communicator, [&] { return slab_aligned_grid(volume, slab_from_ct, options); });
  const std::size_t value_bytes = grid.value_count() * sizeof(std::int16_t);
  const std::size_t bytes = value_bytes + grid.row_count() * sizeof(OccupiedRange);
  const auto values_in = [&](std::byte* memory) {
    return std::span(reinterpret_cast<std::int16_t*>(memory), grid.value_count());
  };
  const auto ranges_in = [&](std::byte* memory) {
    return std::span(reinterpret_cast<OccupiedRange*>(memory + value_bytes), grid.row_count());
  };
  const auto z_rows = static_cast<std::size_t>(grid.size[2]);
  const auto fill = [&](std::span<std::byte> memory, int part, int parts) {
    const auto begin = static_cast<int>(std::int64_t{grid.size[1]} * part / parts);
    const auto end = static_cast<int>(std::int64_t{grid.size[1]} * (part + 1) / parts);
    const auto first_row = static_cast<std::size_t>(begin) * z_rows;
    fill_slices(volume,
                slab_from_ct,
                grid,
                begin,
                end,
                values_in(memory.data()).subspan(grid.slice_offset(begin)),
                ranges_in(memory.data())
                    .subspan(first_row, static_cast<std::size_t>(end) * z_rows - first_row));
  };
  const std::shared_ptr<const std::byte> memory =
      communicator.allocate_on_node_together(bytes, fill);
  auto* base = const_cast<std::byte*>(memory.get());  // only to form views of const elements
  return {grid,
          volume.model(),
          SharedArray<std::int16_t>(memory, values_in(base)),
          SharedArray<OccupiedRange>(memory, ranges_in(base))};
}

}  // namespace af
