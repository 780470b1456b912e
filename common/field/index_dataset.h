// SPDX-License-Identifier: Apache-2.0
// The numbers of one slab's tiles in a field file: created, written, read and hashed.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <hdf5.h>

#include "field/dataset_rule.h"
#include "field/hdf5_handles.h"
#include "field/index_chunks.h"

namespace af::hdf5 {

/// A hash sum over values (indices and means) of a slab, starting at value number `first`. The sums
/// of all blocks of a slab, whichever ranks hold them, add up to a total. It changes when a value
/// is lost, doubled, moved or altered.
std::uint64_t hash_sum(std::uint64_t first, std::span<const std::uint16_t> values);

/// First value and number of values of a block along the axes of index_rule(). They count tiles,
/// but rows along s.
struct DatasetBlock {
  std::array<std::uint64_t, 4> first{};
  std::array<std::uint64_t, 4> count{};
};

/// For rank 0 alone. Creates a group of empty datasets for the tiles that index_rule() describes,
/// packed chunk by chunk.
void create_tiles(hid_t file, const field_layout::DatasetRule& rule, const ChunkShape& chunk);

/// SHA-256 of a slab's numbers, in the order of index_rule(), as the file states it.
std::string stated_sha256(hid_t file, const std::string& group);
void state_sha256(hid_t file, const std::string& group, const std::string& sha256);

/// Which ranks have a file open for writing.
enum class Writers { OneRank, AllRanks };

/// The datasets of one slab's tiles in an open file. Callers see them as index_rule() describes
/// them: a row of codewords along t and, where tiles have means, the row of their means.
class StoredTiles {
 public:
  /// Throws FileError when they do not fit the rule.
  StoredTiles(hid_t file,
              const field_layout::DatasetRule& rule,
              const std::string& path,
              Writers writers = Writers::OneRank);

  /// Reads the planes [u] in order, as many at once as chunks span, into the memory that
  /// `planes_of(u, count)` returns, and calls `done(u, planes)`.
  void read_planes(
      const std::function<std::span<std::uint16_t>(std::uint64_t u, std::uint64_t count)>&
          planes_of,
      const std::function<void(std::uint64_t u, std::span<const std::uint16_t> planes)>& done)
      const;

  /// Collective for Writers::AllRanks. Writes a block's values, or none where
  /// `block` is null. Where tiles have means, the block begins along t at a multiple of
  /// kMeanRunTiles.
  void write(const DatasetBlock* block, std::span<const std::uint16_t> values) const;
  /// Ends the writing of one rank. HDF5 keeps what one rank wrote until here, and says only here
  /// that it could not be stored.
  void close();

 private:
  void write_to(hid_t dataset,
                const DatasetBlock* block,
                std::span<const std::uint16_t> values) const;

  field_layout::DatasetRule rule_;
  Writers writers_;
  Handle codewords_;
  std::optional<Handle> means_;  ///< where tiles have them
};

}  // namespace af::hdf5
