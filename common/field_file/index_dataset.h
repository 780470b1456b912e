// SPDX-License-Identifier: Apache-2.0
// The indices of one slab as a dataset of a field file: made, read and summed up.
#pragma once

#include <cstdint>
#include <functional>
#include <span>

#include <hdf5.h>

#include "field_file/dataset_rule.h"
#include "field_file/field_file.h"
#include "field_file/index_chunks.h"

namespace af::hdf5 {

/// A hash sum over values (indices and means) of a slab, starting at value number `first`. The sums
/// of all blocks of a slab, whichever ranks hold them, add up to a total that changes when a value
/// is lost, doubled, moved or altered.
std::uint64_t hash_sum(std::uint64_t first, std::span<const std::uint16_t> values);

/// Rank 0 alone: an empty dataset of indices, packed chunk by chunk.
void create_index_dataset(hid_t file,
                          const field_layout::DatasetRule& rule,
                          const ChunkShape& chunk,
                          IndexPacking packing);

/// Reads the planes [u] of an index dataset one after the other, as many at once as its chunks
/// span, into `planes_of(u, count)`, which returns memory for them, and calls `done(u, planes)`.
void read_planes(
    hid_t dataset,
    const field_layout::DatasetRule& rule,
    const std::function<std::span<std::uint16_t>(std::uint64_t u, std::uint64_t count)>& planes_of,
    const std::function<void(std::uint64_t u, std::span<const std::uint16_t> planes)>& done);

}  // namespace af::hdf5
