// SPDX-License-Identifier: Apache-2.0
#include "field/parallel_write_check.h"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <string>
#include <system_error>

#include <hdf5.h>

#include "base/error.h"
#include "field/field_layout.h"
#include "field/field_writing.h"
#include "field/index_chunks.h"
#include "ranks/mpi_environment.h"
#include "ranks/work_watch.h"

namespace af {

namespace {

/// Tiles of one viewpoint: parts of four chunks.
constexpr std::array<int, 2> kTestTiles = {kIndexChunkTiles[0] + 2, kIndexChunkTiles[1] + 2};
constexpr int kMostTestBlocks = 64;  ///< a megabyte for any number of ranks
constexpr std::size_t kTestCodewords = 256;
/// HDF5's own metadata cache holds the index of 65536 chunks. The test goes beyond that, but not so
/// far that it takes long.
constexpr std::uint64_t kFewChunks = 1u << 15;
constexpr std::uint64_t kMostTestChunks = 1u << 17;
/// Viewpoint tiles along v, each of which begins a chunk: one block of a rank has this many.
constexpr int kTestChunksOfBlock = 64;

/// A field of one slab, all of which is stored.
CompressedAttenuationField field_of_tiles(const std::array<int, 4>& tiles) {
  CompressedAttenuationField field;
  field.identity.camera.name = "test";
  field.identity.ct.content_sha256 = std::string(64, '0');
  field.light_slab.uv_plane_y_mm = 1.0;
  field.light_slab.u = {0.0, 1.0, 2 * tiles[0]};
  field.light_slab.v = {0.0, 1.0, 2 * tiles[1]};
  SlabGeometry slab;
  slab.s = {0.0, 1.0, 2 * tiles[2]};
  slab.t = {0.0, 1.0, 2 * tiles[3]};
  slab.stored_s = {0, slab.s.nodes};
  slab.stored_t = {0, slab.t.nodes};
  field.light_slab.slabs.push_back(slab);
  field.codebook.codewords.resize(kTestCodewords);
  return field;
}

IndexBlock block_to_test(const std::array<int, 4>& first_tile, const std::array<int, 4>& counts) {
  IndexBlock block;
  block.first_tile = first_tile;
  block.tile_count = counts;
  const int tiles = counts[0] * counts[1] * counts[2] * counts[3];
  for (int i = 0; i < tiles; ++i)
    block.indices.push_back(static_cast<std::uint16_t>((std::int64_t{i} * i + first_tile[0]) %
                                                       static_cast<std::int64_t>(kTestCodewords)));
  return block;
}

/// This rank's blocks of a field of these tiles, each of `along_u` tiles along u. If there are
/// several ranks, the last has none.
std::vector<IndexBlock> blocks_to_test(const std::array<int, 4>& tiles,
                                       int along_u,
                                       const Communicator& communicator) {
  const int writers = std::max(1, communicator.size() - 1);
  std::vector<IndexBlock> blocks;
  if (communicator.rank() < writers)
    for (int u = communicator.rank() * along_u; u < tiles[0]; u += writers * along_u)
      blocks.push_back(block_to_test({u, 0, 0, 0}, {along_u, tiles[1], tiles[2], tiles[3]}));
  return blocks;
}

std::string versions_text() {
  std::array<unsigned, 3> hdf5{};
  H5get_libversion(hdf5.data(), &hdf5[1], &hdf5[2]);
  const char* const io = std::getenv("OMPI_MCA_io");
  return "HDF5 " + std::to_string(hdf5[0]) + "." + std::to_string(hdf5[1]) + "." +
         std::to_string(hdf5[2]) + ", " + mpi_version() + ", OMPI_MCA_io " +
         (io == nullptr ? "not set" : io);
}

/// Collective. Writes a field of these tiles as any field is written, verifies it and removes it.
void write_to_test(const std::array<int, 4>& tiles,
                   int along_u,
                   const std::filesystem::path& path,
                   const Communicator& communicator,
                   const MpiIoHints& hints) {
  constexpr double kLimitMinutes = 2.0;
  const std::string advice =
      " (" + versions_text() + "): precompute/README.md has what to try, under Parallel writing";
  const std::filesystem::path test = field_layout::io_test_path(path);
  const WorkNote note("testing collective writes to " + test.string() + advice,
                      WorkNote::Kind::Phase,
                      kLimitMinutes);
  const auto said = [&](const Error& error) {
    return "the test of collective writes before the work failed: " + std::string(error.what()) +
           advice;
  };
  try {
    write_field(field_of_tiles(tiles),
                blocks_to_test(tiles, along_u, communicator),
                {"0", "test", "", "{}"},
                test,
                communicator,
                hints);
  } catch (const RemoteError& error) {
    throw RemoteError(error.exit_code(), said(error));
  } catch (const Error& error) {
    throw FileError(test.string(), said(error));
  }
  std::error_code ignored;
  if (communicator.is_root()) std::filesystem::remove(test, ignored);
}

}  // namespace

void check_parallel_writing(const std::filesystem::path& path,
                            const Communicator& communicator,
                            const MpiIoHints& hints) {
  const int blocks = std::clamp(communicator.size() - 1, 1, kMostTestBlocks);
  write_to_test({blocks, 1, kTestTiles[0], kTestTiles[1]}, 1, path, communicator, hints);
}

void check_writing_many_chunks(const FieldLattice& lattice,
                               const std::filesystem::path& path,
                               const Communicator& communicator,
                               const MpiIoHints& hints) {
  const std::uint64_t chunks = hdf5::chunk_count(field_layout::index_rules(lattice, false));
  if (chunks <= kFewChunks) return;
  const auto rows = static_cast<int>(std::min(chunks, kMostTestChunks) / kTestChunksOfBlock + 1);
  write_to_test({rows * kIndexChunkTilesAlongU, kTestChunksOfBlock, 1, 1},
                kIndexChunkTilesAlongU,
                path,
                communicator,
                hints);
}

}  // namespace af
