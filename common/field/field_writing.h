// SPDX-License-Identifier: Apache-2.0
// Writes fields and atlases: by parallel HDF5 where MPI runs, else from rank 0.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "field/attenuation_atlas.h"
#include "field/compressed_attenuation_field.h"
#include "field/field_file.h"
#include "ranks/communicator.h"

namespace af {

/// A block of tile indices (and means) that one rank has of one slab: half-open tile ranges, and
/// the indices stored as Codebook says.
struct IndexBlock {
  std::size_t slab = 0;
  std::array<int, 4> first_tile = {0, 0, 0, 0};
  std::array<int, 4> tile_count = {0, 0, 0, 0};
  std::vector<std::uint16_t> indices;

  auto members() { return std::tie(slab, first_tile, tile_count, indices); }
};

/// Tiles along s and t that one chunk of a file spans, where the slab has as many. Along u it spans
/// kIndexChunkTilesAlongU, unless that makes planes too large. A DRR looks at a few viewpoints and
/// at a part of their (s,t) plane. Blocks that begin and end at multiples of these sizes are
/// written without reading chunks back. Chunks of fields larger than 32 GiB are larger.
inline constexpr std::array<int, 2> kIndexChunkTiles = {32, 64};
inline constexpr int kIndexChunkTilesAlongU = 8;
/// Where tiles have means, a block begins along t at a multiple of this many tiles: between these,
/// the file holds means as differences.
inline constexpr int kMeanRunTiles = 16;

/// Returns this rank's next blocks, or none when it has no more. Every rank calls it equally often,
/// until no rank has any left. An exception is thrown on every rank.
using NextBlocks = std::function<std::vector<IndexBlock>()>;
/// Called on every rank after the last block.
using MakeProvenance = std::function<FieldProvenance()>;

/// Hints to MPI-IO on how to write: names and values ("cb_nodes", "8"). It ignores unknown ones.
/// Without MPI they say nothing.
using MpiIoHints = std::vector<std::pair<std::string, std::string>>;

/// Collective. Writes `field` with the blocks of all ranks to "PATH.partial",
/// closes it, reads it back to verify it (ranks share its slabs), syncs and renames. The index
/// arrays of the field's slabs are ignored; every rank gives its codebook.
/// Blocks are asked for and written in rounds, one collective write per round and slab, so that no
/// rank need hold more than one round's. Ranks without a block take part. Returns the same info on
/// every rank.
/// After a failed write, MPI-IO and HDF5 can be neither used nor finalised. The ranks that know of
/// the failure throw, alone, and is_abort_required() is true.
FieldFileInfo write_field(const CompressedAttenuationField& field,
                          const NextBlocks& next_blocks,
                          const MakeProvenance& make_provenance,
                          const std::filesystem::path& path,
                          const Communicator& communicator,
                          const MpiIoHints& hints = {});
/// Collective. The same with all blocks in one round.
FieldFileInfo write_field(const CompressedAttenuationField& field,
                          const std::vector<IndexBlock>& my_blocks,
                          const FieldProvenance& provenance,
                          const std::filesystem::path& path,
                          const Communicator& communicator,
                          const MpiIoHints& hints = {});

/// Collective. write_field() for an atlas. A block's slab number counts over the slabs of all
/// members. The identity of every member must name the atlas's CT and attenuation.
FieldFileInfo write_atlas(const AttenuationAtlas& atlas,
                          const NextBlocks& next_blocks,
                          const MakeProvenance& make_provenance,
                          const std::filesystem::path& path,
                          const Communicator& communicator,
                          const MpiIoHints& hints = {});

/// For rank 0 alone, before the work: announce_output() of a field and of what write_field() and
/// check_parallel_writing() put beside it.
void announce_field(const std::filesystem::path& path);

}  // namespace af
