// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cstdlib>
#include <string>
#include <system_error>

#include <hdf5.h>
#include <mpi.h>

#include "base/error.h"
#include "io/field_file.h"
#include "io/field_file_layout.h"
#include "parallel/work_watch.h"

namespace af {

namespace {

/// Tiles of one viewpoint: parts of four chunks.
constexpr std::array<int, 2> kTestTiles = {kIndexChunkTiles[0] + 2, kIndexChunkTiles[1] + 2};
constexpr int kMostTestBlocks = 64;  ///< a megabyte, however many ranks there are
constexpr std::size_t kTestCodewords = 256;

/// One viewpoint tile per rank that writes.
CompressedAttenuationField field_to_test(int blocks) {
  CompressedAttenuationField field;
  field.identity.camera.name = "test";
  field.identity.ct_content_sha256 = std::string(64, '0');
  field.light_slab.uv_plane_y_mm = 1.0;
  field.light_slab.u = {0.0, 1.0, 2 * blocks};
  field.light_slab.v = {0.0, 1.0, 2};
  SlabGeometry slab;
  slab.s = {0.0, 1.0, 2 * kTestTiles[0]};
  slab.t = {0.0, 1.0, 2 * kTestTiles[1]};
  slab.stored_s = {0, slab.s.nodes};
  slab.stored_t = {0, slab.t.nodes};
  field.light_slab.slabs.push_back(slab);
  field.codebook.codewords.resize(kTestCodewords);
  return field;
}

/// This rank's block: none on the last of several ranks.
std::vector<IndexBlock> blocks_to_test(int blocks, int rank) {
  if (rank >= blocks) return {};
  IndexBlock block;
  block.first_tile = {rank, 0, 0, 0};
  block.tile_count = {1, 1, kTestTiles[0], kTestTiles[1]};
  const auto tiles = static_cast<std::size_t>(kTestTiles[0] * kTestTiles[1]);
  for (std::size_t i = 0; i < tiles; ++i)
    block.indices.push_back(
        static_cast<std::uint16_t>((i * i + static_cast<std::size_t>(rank)) % kTestCodewords));
  return {block};
}

std::string versions_text() {
  std::array<unsigned, 3> hdf5{};
  H5get_libversion(hdf5.data(), &hdf5[1], &hdf5[2]);
  std::string mpi(MPI_MAX_LIBRARY_VERSION_STRING, '\0');
  int length = 0;
  MPI_Get_library_version(mpi.data(), &length);
  mpi.resize(static_cast<std::size_t>(length));
  mpi.resize(std::min(mpi.size(), mpi.find_first_of(",\n")));
  const char* const io = std::getenv("OMPI_MCA_io");
  return "HDF5 " + std::to_string(hdf5[0]) + "." + std::to_string(hdf5[1]) + "." +
         std::to_string(hdf5[2]) + ", " + mpi + ", OMPI_MCA_io " + (io == nullptr ? "not set" : io);
}

}  // namespace

void check_parallel_writing(const std::filesystem::path& path,
                            const Communicator& communicator,
                            const MpiIoHints& hints) {
  constexpr double kLimitMinutes = 2.0;
  const std::string advice =
      " (" + versions_text() + "): precompute/README.md has what to try, under Parallel writing";
  const std::filesystem::path test = field_layout::io_test_path(path);
  const WorkNote note("testing collective writes to " + test.string() + advice,
                      WorkNote::Kind::Phase,
                      kLimitMinutes);
  const int blocks = std::clamp(communicator.size() - 1, 1, kMostTestBlocks);
  const auto said = [&](const Error& error) {
    return "the test of collective writes before the work failed: " + std::string(error.what()) +
           advice;
  };
  try {
    write_field(field_to_test(blocks),
                blocks_to_test(blocks, communicator.rank()),
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

}  // namespace af
