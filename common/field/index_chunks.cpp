// SPDX-License-Identifier: Apache-2.0
#include "field/index_chunks.h"

#include <algorithm>

#include "field/field_layout.h"
#include "field/field_writing.h"
#include "field/hdf5_calls.h"

namespace af::hdf5 {

using field_layout::DatasetRule;

namespace {

constexpr int kMostDoublings = 16;

/// Tiles along u that a chunk spans. Whoever reads a field holds this many planes of equal u. If
/// there are few tiles, the first chunk spans the middle and its neighbours and leaves out the last
/// ones, so that a DRR near nominal needs one of two chunks.
hsize_t tiles_along_u(const std::vector<std::uint64_t>& extents) {
  constexpr std::uint64_t kMostTilesAtOnce = std::uint64_t{16} << 20;
  const std::uint64_t plane = extents[1] * extents[2] * extents[3];
  hsize_t tiles = std::min<hsize_t>(kIndexChunkTilesAlongU, extents[0] / 2 + 2);
  while (tiles > 1 && tiles * plane > kMostTilesAtOnce) tiles /= 2;
  return std::min<hsize_t>(tiles, extents[0]);
}

/// The shape after this many doublings, or after fewer where it cannot grow further.
ChunkShape chunk_shape(const DatasetRule& rule, int doublings) {
  const std::vector<std::uint64_t> extents = field_layout::codewords_rule(rule).extents;
  ChunkShape shape = {tiles_along_u(extents),
                      1,
                      std::min<hsize_t>(kIndexChunkTiles[0], extents[2]),
                      std::min<hsize_t>(kIndexChunkTiles[1], extents[3])};
  std::uint64_t elements = shape[0] * shape[2] * shape[3];
  for (const std::size_t axis : {1u, 2u, 3u, 0u})
    for (; doublings > 0 && shape[axis] < extents[axis] && 2 * elements <= kMaxChunkElements;
         --doublings) {
      shape[axis] *= 2;
      elements *= 2;
    }
  // HDF5 refuses a chunk that is larger than a dataset of fixed size.
  for (std::size_t axis = 0; axis < shape.size(); ++axis)
    shape[axis] = std::min<hsize_t>(shape[axis], extents[axis]);
  return shape;
}

std::vector<ChunkShape> chunk_shapes(const std::vector<DatasetRule>& rules, int doublings) {
  std::vector<ChunkShape> shapes;
  shapes.reserve(rules.size());
  for (const DatasetRule& rule : rules) shapes.push_back(chunk_shape(rule, doublings));
  return shapes;
}

std::uint64_t count_of(const std::vector<DatasetRule>& rules,
                       const std::vector<ChunkShape>& shapes) {
  std::uint64_t count = 0;
  for (std::size_t k = 0; k < rules.size(); ++k) {
    const std::vector<std::uint64_t> extents = field_layout::codewords_rule(rules[k]).extents;
    std::uint64_t of_slab = rules[k].rows_per_tile;  // datasets
    for (std::size_t axis = 0; axis < 4; ++axis)
      of_slab *= (extents[axis] + shapes[k][axis] - 1) / shapes[k][axis];
    count += of_slab;
  }
  return count;
}

}  // namespace

std::vector<ChunkShape> index_chunks(const std::vector<DatasetRule>& rules) {
  std::vector<ChunkShape> shapes = chunk_shapes(rules, 0);
  for (int doublings = 1; doublings <= kMostDoublings && count_of(rules, shapes) > kMostSmallChunks;
       ++doublings)
    shapes = chunk_shapes(rules, doublings);
  return shapes;
}

std::uint64_t chunk_count(const std::vector<DatasetRule>& rules) {
  return count_of(rules, index_chunks(rules));
}

void hold_chunk_index(hid_t file_access, std::uint64_t chunks) {
  // A chunk's entry has at most 8 bytes of address, 4 of size and 4 of filter mask. HDF5 begins to
  // write when less than a fraction (min_clean_fraction, 0.3) of the cache is clean or empty.
  constexpr std::uint64_t kEntryBytes = 16;
  constexpr std::uint64_t kShareOfIndex = 4;
  constexpr std::uint64_t kOtherBytes = 4u << 20;
  constexpr std::uint64_t kLargest = 128u << 20;  // of HDF5
  H5AC_cache_config_t cache{};
  cache.version = H5AC__CURR_CACHE_CONFIG_VERSION;
  checked(H5Pget_mdc_config(file_access, &cache), "H5Pget_mdc_config");
  cache.set_initial_size = true;
  cache.initial_size = std::min(kLargest, kOtherBytes + kShareOfIndex * kEntryBytes * chunks);
  cache.min_size = cache.initial_size;
  cache.max_size = cache.initial_size;
  cache.incr_mode = H5C_incr__off;
  cache.flash_incr_mode = H5C_flash_incr__off;
  cache.decr_mode = H5C_decr__off;
  checked(H5Pset_mdc_config(file_access, &cache), "H5Pset_mdc_config");
}

}  // namespace af::hdf5
