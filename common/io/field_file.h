// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "field/compressed_attenuation_field.h"
#include "parallel/communicator.h"

namespace af {

/// Strings stored beside a field: program, version, command line, options_toml, seed, rank count,
/// training statistics (JSON).
struct FieldProvenance {
  std::string source_version;
  std::string command_line;
  std::string options_toml;
  std::string provenance_json;
};

struct FieldFileInfo {
  FieldProvenance provenance;
  std::string payload_sha256;  ///< over the named datasets in fixed order
  std::uint64_t file_bytes = 0;
  std::uint64_t payload_bytes = 0;  ///< indices + codebook, by the bits stored
};

/// A block of tile indices of one slab that one rank has: half-open tile ranges and the indices,
/// [u][v][s][t].
struct IndexBlock {
  std::size_t slab = 0;
  std::array<int, 4> first_tile = {0, 0, 0, 0};
  std::array<int, 4> tile_count = {0, 0, 0, 0};
  std::vector<std::uint16_t> indices;
};

/// Collective. Writes `field` (its slabs' index arrays are ignored) with the blocks of all ranks by
/// parallel HDF5 to "PATH.partial", closes it, verifies it by reading it back on rank 0, syncs and
/// renames. Ranks without a block take part. Returns the same info on every rank.
FieldFileInfo write_field(const CompressedAttenuationField& field,
                          const std::vector<IndexBlock>& my_blocks,
                          const FieldProvenance& provenance,
                          const std::filesystem::path& path,
                          const Communicator& communicator);

/// Collective. Rank 0 reads and verifies (extents against dataspaces before allocating, checksums,
/// index range), the rest receive it; indices are held once per node. FileError (exit 4) on
/// anything that does not fit: names path, dataset, expected, found.
std::shared_ptr<const CompressedAttenuationField> read_field(const std::filesystem::path& path,
                                                             const Communicator& communicator,
                                                             FieldFileInfo* info = nullptr);

}  // namespace af
