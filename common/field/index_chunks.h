// SPDX-License-Identifier: Apache-2.0
// How indices are cut into chunks, and what HDF5 needs for the chunks. Internal to field_file.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <hdf5.h>

#include "field/dataset_rule.h"

namespace af::hdf5 {

/// Most elements of a chunk that is read or written. HDF5 holds a chunk whole.
inline constexpr std::uint64_t kMaxChunkElements = 1u << 20;
/// Chunks grow when all slabs together have more than these: 32 GiB in chunks of 32 KiB. While a
/// field is written, every rank holds about 100 bytes per chunk.
inline constexpr std::uint64_t kMostSmallChunks = 1u << 20;

using ChunkShape = std::array<hsize_t, 4>;

/// The chunks of every slab's codewords. They span kIndexChunkTiles, and along u
/// kIndexChunkTilesAlongU, or fewer where that many planes of equal u are large. Chunks of means,
/// if any, span the same tiles. Fields of more than kMostSmallChunks chunks take larger ones:
/// doubled first along v, so that such planes remain whole chunks, and only then along s, t and u.
std::vector<ChunkShape> index_chunks(const std::vector<field_layout::DatasetRule>& rules);

/// Chunks of all index datasets together.
std::uint64_t chunk_count(const std::vector<field_layout::DatasetRule>& rules);

/// Lets HDF5 hold the index of this many chunks in its metadata cache. When the cache fills up,
/// HDF5 1.10 to 1.12 write parts of the index amid a collective write of chunks, and with the MPI
/// types of the chunks: 'Bad address', or a crash (issue 265 of HDFGroup/hdf5).
void hold_chunk_index(hid_t file_access, std::uint64_t chunks);

}  // namespace af::hdf5
