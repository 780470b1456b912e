// SPDX-License-Identifier: Apache-2.0
// Internal to field_file: IndexCoding as an HDF5 filter, so that chunks of indices are coded where
// HDF5 would deflate them, on any number of ranks.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include <hdf5.h>

#include "base/thread_pool.h"
#include "field/index_coding.h"
#include "field_file/index_chunks.h"

namespace af::hdf5 {

/// Of the range that The HDF Group leaves for use within a program.
inline constexpr H5Z_filter_t kIndexFilter = 411;

/// While this object lives, datasets with the filter can be read and written: HDF5 passes a filter
/// nothing but a chunk, so the codebook comes from here. A second object replaces the first until
/// it is destroyed. Not for several threads.
class IndexFilter {
 public:
  /// `threads`: for read_coded_planes().
  explicit IndexFilter(const Codebook& codebook, int threads = usable_processors());
  ~IndexFilter();
  IndexFilter(const IndexFilter&) = delete;
  IndexFilter& operator=(const IndexFilter&) = delete;

  [[nodiscard]] const IndexCoding& coding() const { return coding_; }
  /// Its threads start with the first call.
  [[nodiscard]] ThreadPool& pool();

 private:
  IndexCoding coding_;
  int threads_;
  std::optional<ThreadPool> pool_;
  IndexFilter* outer_;
};

/// Reads the chunks of a coded dataset that begin at plane u, and decodes them on the threads of
/// the IndexFilter: HDF5 would do so one after the other. `planes` has room for `count` planes of
/// equal u, as many as a chunk spans or as are left. Throws std::runtime_error when chunks cannot
/// be decoded.
void read_coded_planes(hid_t dataset,
                       const field_layout::DatasetRule& rule,
                       const ChunkShape& chunk,
                       std::uint64_t u,
                       std::uint64_t count,
                       std::span<std::uint16_t> planes);

/// Puts the filter into the properties of a dataset to be made of such chunks.
void add_index_filter(hid_t creation, const ChunkShape& chunk);

/// Whether a dataset has the filter; `chunk` is then its chunks' shape.
bool is_coded(hid_t dataset, ChunkShape& chunk);

/// Why the only filter of these properties cannot come from add_index_filter(): its version is
/// unknown, or its shape is not the chunks'. Empty when it can.
std::string index_filter_problem(hid_t creation);

}  // namespace af::hdf5
