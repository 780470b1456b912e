// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "field/attenuation_atlas.h"
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

/// How the indices are packed in the file. Without loss: the payload is the same.
enum class IndexPacking {
  CodebookTree,  ///< by IndexCoding; needs these programs to be read
  Deflate,       ///< by HDF5's shuffle and deflate; any reader of HDF5 can, and older programs
};

struct FieldFileInfo {
  FieldProvenance provenance;
  std::string payload_sha256;  ///< over the named datasets in fixed order
  std::uint64_t file_bytes = 0;
  std::uint64_t payload_bytes = 0;  ///< indices, means and codebook, by the bits stored
  /// How DRRs are meant to be looked up, by its options: "linear", also where they do not say, or
  /// "cubic".
  std::string look_up = "linear";
  IndexPacking packing = IndexPacking::CodebookTree;
};

/// A block of tile indices (and means) of one slab that one rank has: half-open tile ranges and the
/// indices, stored as Codebook says.
struct IndexBlock {
  std::size_t slab = 0;
  std::array<int, 4> first_tile = {0, 0, 0, 0};
  std::array<int, 4> tile_count = {0, 0, 0, 0};
  std::vector<std::uint16_t> indices;
};

/// Tiles along s and along t that one chunk of an index dataset spans, where the slab has as many;
/// along u it spans kIndexChunkTilesAlongU where that does not make planes too large. Blocks that
/// begin and end at multiples of them are written without reading chunks back. Chunks of fields of
/// more than 16 GiB are larger.
inline constexpr std::array<int, 2> kIndexChunkTiles = {128, 64};
inline constexpr int kIndexChunkTilesAlongU = 8;

/// This rank's next blocks, none when it has no more. Called on every rank equally often, until no
/// rank has any left; what it throws is thrown on every rank.
using NextBlocks = std::function<std::vector<IndexBlock>()>;
/// Called on every rank after the last block.
using MakeProvenance = std::function<FieldProvenance()>;

/// How MPI-IO is to write: names and values of its hints ("cb_nodes", "8"). Those that it does not
/// know it ignores.
using MpiIoHints = std::vector<std::pair<std::string, std::string>>;

/// Collective. Writes `field` (its slabs' index arrays are ignored; every rank gives its codebook)
/// with the blocks of all ranks by parallel HDF5 to "PATH.partial", closes it, verifies it by
/// reading it back on rank 0, syncs and renames. Blocks are asked for and written in rounds, one
/// collective write per round and slab, so that no rank need hold more than one round's; ranks
/// without a block take part. Returns the same info on every rank. When a write fails, MPI-IO and
/// HDF5 cannot be used or finalised any more: the ranks that know of it throw, alone, and
/// MpiEnvironment::is_abort_required() is true.
FieldFileInfo write_field(const CompressedAttenuationField& field,
                          const NextBlocks& next_blocks,
                          const MakeProvenance& make_provenance,
                          const std::filesystem::path& path,
                          const Communicator& communicator,
                          const MpiIoHints& hints = {},
                          IndexPacking packing = IndexPacking::CodebookTree);
/// Collective. The same in one round.
FieldFileInfo write_field(const CompressedAttenuationField& field,
                          const std::vector<IndexBlock>& my_blocks,
                          const FieldProvenance& provenance,
                          const std::filesystem::path& path,
                          const Communicator& communicator,
                          const MpiIoHints& hints = {},
                          IndexPacking packing = IndexPacking::CodebookTree);

/// Collective. As write_field(), of an atlas: a block's slab counts over the slabs of all members.
/// The identity of every member names the atlas's CT and attenuation.
FieldFileInfo write_atlas(const AttenuationAtlas& atlas,
                          const NextBlocks& next_blocks,
                          const MakeProvenance& make_provenance,
                          const std::filesystem::path& path,
                          const Communicator& communicator,
                          const MpiIoHints& hints = {},
                          IndexPacking packing = IndexPacking::CodebookTree);

/// Rank 0 alone, before the work: announce_output() of a field and of what write_field() and
/// check_parallel_writing() put beside it.
void announce_field(const std::filesystem::path& path);

/// Collective. Writes about a megabyte to "PATH.io-test" as write_field() will write a field to
/// `path`, with ranks that have nothing to write, verifies it and removes it. A file system, HDF5
/// or MPI-IO that cannot do this is found before the work, not after it. FileError with their
/// versions.
void check_parallel_writing(const std::filesystem::path& path,
                            const Communicator& communicator,
                            const MpiIoHints& hints = {});
/// Collective. The same for a field of so many chunks that HDF5's index of them has to be held in a
/// larger metadata cache than its own: little data in as many chunks, but at most 131072. Does
/// nothing for smaller fields.
void check_writing_many_chunks(const FieldLattice& lattice,
                               const std::filesystem::path& path,
                               const Communicator& communicator,
                               const MpiIoHints& hints = {});

/// Collective. Rank 0's geometry on every rank: sizing uses libm, whose last bit may differ between
/// processors.
void share_geometry(LightSlab& light_slab, const Communicator& communicator);

/// One rank alone, and quick: a field without its indices (identity, geometry, codebook), verified
/// as read_field() does. FileError.
CompressedAttenuationField read_field_header(const std::filesystem::path& path);

/// Collective. Rank 0 reads and verifies (extents against dataspaces before allocating, checksums,
/// index range), the rest receive it; indices are held once per node. FileError (exit 4) on
/// anything that does not fit: names path, dataset, expected, found. A field of bone's part alone
/// is refused, too.
std::shared_ptr<const CompressedAttenuationField> read_field(const std::filesystem::path& path,
                                                             const Communicator& communicator,
                                                             FieldFileInfo* info = nullptr);

/// FileError when a field or an atlas, in the file `path`, is not of the bone's part that belongs
/// to one of all: it must be of the same CT and attenuation.
void require_bone_of(const FieldIdentity& all,
                     const FieldIdentity& found,
                     const std::filesystem::path& path);

/// Collective. As read_field(), of either material.
std::shared_ptr<const CompressedAttenuationField> read_field_of_any_material(
    const std::filesystem::path& path,
    const Communicator& communicator,
    FieldFileInfo* info = nullptr);

/// Where programs look for the field of bone's part beside a field: A.bone.af.h5 beside A.af.h5.
std::filesystem::path bone_field_path(const std::filesystem::path& path);

/// One rank alone, and quick: whether a file says that it is an atlas. FileError when it is neither
/// atlas nor field.
bool is_atlas_file(const std::filesystem::path& path);

/// One rank alone, and quick: an atlas, verified as read_field() verifies but for the indices.
/// FileError.
AttenuationAtlas read_atlas_header(const std::filesystem::path& path);

/// Collective. The same on every rank; no indices are read.
std::shared_ptr<const AttenuationAtlas> read_atlas(const std::filesystem::path& path,
                                                   const Communicator& communicator,
                                                   FieldFileInfo* info = nullptr);

/// Collective. One member of an atlas, read and verified as a field; indices are held once per
/// node. `payload_sha256`: of the atlas as it was read before; FileError when the file has become
/// another. With Communicator::alone() threads may call it.
std::shared_ptr<const CompressedAttenuationField> read_atlas_member(
    const std::filesystem::path& path,
    std::size_t member,
    const std::string& payload_sha256,
    const Communicator& communicator);

}  // namespace af
