// SPDX-License-Identifier: Apache-2.0
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <limits>

#include <gtest/gtest.h>

#include "base/error.h"
#include "base/hash_random.h"
#include "base/stored_bytes.h"
#include "field/field_layout.h"
#include "field/field_reading.h"
#include "field/field_writing.h"
#include "field/hdf5_calls.h"
#include "field/index_chunks.h"
#include "field/parallel_write_check.h"
#include "files/sha256.h"
#include "support/shared_folder.h"

namespace af {
namespace {

constexpr std::uint64_t kSeed = 5;
/// Of small_field(). Frozen: made by these tests on one rank with format version 1.
constexpr const char* kPayloadSha256 =
    "c2a920a26c8f1bee1f140cfab18ba74be78244667ae2dece51c9658bcd7d17fc";

/// Two slabs of odd and even sizes; numbers chosen to be exact.
CompressedAttenuationField small_field() {
  CompressedAttenuationField field;
  CameraGeometry& camera = field.identity.camera;
  camera.name = "AP";
  camera.source_point = {0.0, -650.0, 0.0};
  camera.detector_origin_point = {-150.0, 370.0, 150.0};
  camera.row_direction = {0.0, 0.0, -1.0};
  camera.pixel_spacing_mm = {1.25, 1.25};
  camera.size_px = {256, 256};
  field.identity.frame.center_ct_mm = {1.0, 2.0, 3.0};
  field.identity.range = {0.125, 100.0};
  field.identity.ct.content_sha256 = std::string(64, 'a');
  CtGrid& ct = field.identity.ct.grid;
  ct.size = {5, 6, 7};
  ct.origin_mm = {-0.1, 2.0 / 3.0, 1e3 / 7.0};
  ct.spacing_mm = {0.3, 0.7, 1.1};
  ct.direction << 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0;
  field.light_slab.slab_from_ct.translation() = Eigen::Vector3d(0.5, 0.25, -4.0);
  field.light_slab.uv_plane_y_mm = 650.0;
  field.light_slab.u = {-280.0, 280.0, 7};
  field.light_slab.v = {-270.0, 270.0, 6};
  SlabGeometry slab;
  slab.s = {-260.0, 250.0, 21};
  slab.t = {-240.0, 230.0, 24};
  slab.stored_s = {2, 19};
  slab.stored_t = {4, 12};
  slab.y_high_mm = 10.0;
  field.light_slab.slabs.push_back(slab);
  slab.st_plane_y_mm = 40.0;
  slab.y_low_mm = 10.0;
  slab.y_high_mm = std::numeric_limits<double>::infinity();
  slab.stored_s = {0, 4};
  slab.stored_t = {6, 18};
  field.light_slab.slabs.push_back(slab);
  field.quantizer_step = 0.00390625f;
  for (std::uint16_t i = 0; i < 50; ++i) {
    Tile tile{};
    tile.fill(static_cast<std::uint16_t>(3 * i));
    field.codebook.codewords.push_back(tile);
  }
  return field;
}

std::uint16_t index_at(const std::array<int, 4>& tile, std::size_t slab) {
  const auto key =
      static_cast<std::uint64_t>(((tile[0] * 64 + tile[1]) * 64 + tile[2]) * 64 + tile[3]);
  return static_cast<std::uint16_t>(hash64(kSeed, slab, key) % 50);
}

/// The slab's tiles in blocks of at most 1 x 2 x 3 x all tiles.
std::vector<IndexBlock> all_blocks(const CompressedAttenuationField& field) {
  std::vector<IndexBlock> blocks;
  for (std::size_t k = 0; k < field.light_slab.slabs.size(); ++k) {
    const std::array<int, 4> tiles = field.lattice(k).tile_counts();
    for (int a = 0; a < tiles[0]; ++a)
      for (int b = 0; b < tiles[1]; b += 2)
        for (int c = 0; c < tiles[2]; c += 3) {
          IndexBlock block;
          block.slab = k;
          block.first_tile = {a, b, c, 0};
          block.tile_count = {1, std::min(2, tiles[1] - b), std::min(3, tiles[2] - c), tiles[3]};
          for (int j = 0; j < block.tile_count[1]; ++j)
            for (int s = 0; s < block.tile_count[2]; ++s)
              for (int t = 0; t < block.tile_count[3]; ++t)
                block.indices.push_back(index_at({a, b + j, c + s, t}, k));
          blocks.push_back(std::move(block));
        }
  }
  return blocks;
}

/// This rank's part of the blocks. The last of several ranks has none.
std::vector<IndexBlock> dealt(const std::vector<IndexBlock>& blocks, const Communicator& world) {
  const int dealt_to = std::max(1, world.size() - 1);
  std::vector<IndexBlock> mine;
  for (std::size_t i = 0; i < blocks.size(); ++i)
    if (static_cast<int>(hash64(kSeed, i) % static_cast<std::uint64_t>(dealt_to)) == world.rank())
      mine.push_back(blocks[i]);
  return mine;
}

FieldProvenance some_provenance() {
  return {"0.1.0", "af-precompute --ct x", "seed = 1\n", "{\"ranks\": 1}"};
}

FieldFileInfo write(const CompressedAttenuationField& field, const std::filesystem::path& path) {
  const Communicator world = Communicator::world();
  // Removed first, because a program never replaces what it has read.
  test::remove_shared_file(path);
  return write_field(field, dealt(all_blocks(field), world), some_provenance(), path, world);
}

/// Runs `edit` on the file on rank 0.
void edit_file(const std::filesystem::path& path, const std::function<void(hid_t)>& edit) {
  const Communicator world = Communicator::world();
  world.barrier();  // HDF5 refuses to write a file that another rank still reads
  if (world.is_root()) {
    const hdf5::Handle file = hdf5::open_file(path, H5F_ACC_RDWR);
    edit(file);
  }
  world.barrier();
}

/// The message of the FileError that reading the file throws on this rank. Without one the test
/// fails.
std::string refusal(const std::filesystem::path& path) {
  try {
    read_field(path, Communicator::world());
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::File) << error.what();
    return error.what();
  }
  ADD_FAILURE() << path << " was read";
  return "";
}

TEST(FieldFile, SaysWhereAllAttenuationEnds) {
  const test::SharedFolder folder;
  CompressedAttenuationField field = small_field();
  for (const double end_mm : {123.25, std::numeric_limits<double>::infinity()}) {
    field.light_slab.attenuation_end_y_mm = end_mm;
    write(field, folder / "a.af.h5");
    const auto read = read_field(folder / "a.af.h5", Communicator::world());
    EXPECT_EQ(read->light_slab.attenuation_end_y_mm, end_mm);
    EXPECT_TRUE(std::isinf(read->light_slab.slabs.back().y_high_mm));
  }
}

TEST(FieldFile, ReadsBackWhatRanksWroteTogether) {
  const test::SharedFolder folder;
  const CompressedAttenuationField field = small_field();
  const FieldFileInfo written = write(field, folder / "a.af.h5");
  EXPECT_FALSE(std::filesystem::exists(folder / "a.af.h5.partial"));
  FieldFileInfo info;
  const auto read = read_field(folder / "a.af.h5", Communicator::world(), &info);
  EXPECT_EQ(info.payload_sha256, written.payload_sha256);
  EXPECT_EQ(info.file_bytes, written.file_bytes);
  EXPECT_EQ(info.payload_bytes, written.payload_bytes);
  EXPECT_EQ(info.provenance.command_line, some_provenance().command_line);
  EXPECT_EQ(info.provenance.provenance_json, some_provenance().provenance_json);
  EXPECT_EQ(read->codebook.codewords, field.codebook.codewords);
  EXPECT_EQ(read->quantizer_step, field.quantizer_step);
  EXPECT_EQ(read->identity.camera.name, "AP");
  EXPECT_EQ(read->identity.camera.size_px, field.identity.camera.size_px);
  EXPECT_EQ(bytes_of(read->identity.ct), bytes_of(field.identity.ct));
  EXPECT_EQ(read->identity.frame.center_ct_mm, field.identity.frame.center_ct_mm);
  EXPECT_EQ(read->light_slab.slab_from_ct.matrix(), field.light_slab.slab_from_ct.matrix());
  ASSERT_EQ(read->slabs.size(), 2u);
  for (std::size_t k = 0; k < 2; ++k) {
    const SlabGeometry& expected = field.light_slab.slabs[k];
    const SlabGeometry& found = read->light_slab.slabs[k];
    EXPECT_EQ(found.y_low_mm, expected.y_low_mm);
    EXPECT_EQ(found.y_high_mm, expected.y_high_mm);
    EXPECT_EQ(found.stored_s.begin, expected.stored_s.begin);
    EXPECT_EQ(found.stored_t.count, expected.stored_t.count);
    std::size_t next = 0;
    const std::array<int, 4> tiles = field.lattice(k).tile_counts();
    for (int a = 0; a < tiles[0]; ++a)
      for (int b = 0; b < tiles[1]; ++b)
        for (int c = 0; c < tiles[2]; ++c)
          for (int d = 0; d < tiles[3]; ++d)
            ASSERT_EQ(read->slabs[k].indices[next++], index_at({a, b, c, d}, k));
  }
}

TEST(FieldFile, NamesTheLookUpThatItIsMeantFor) {
  const test::SharedFolder folder;
  const Communicator world = Communicator::world();
  const CompressedAttenuationField field = small_field();
  FieldProvenance provenance = some_provenance();
  const auto look_up_of = [&](const std::string& options) {
    provenance.options_toml = options;
    write_field(field, dealt(all_blocks(field), world), provenance, folder / "a.af.h5", world);
    FieldFileInfo info;
    read_field(folder / "a.af.h5", world, &info);
    return info.look_up;
  };
  EXPECT_EQ(look_up_of("slabs = 1\n"), "linear");
  EXPECT_EQ(look_up_of("slabs = 4\nlook_up = \"cubic\"\nseed = 1\n"), "cubic");
  EXPECT_EQ(look_up_of("look_up = \"linear\""), "linear");
  provenance.options_toml = "look_up = \"$(reboot)\"\n";
  write_field(field, dealt(all_blocks(field), world), provenance, folder / "b.af.h5", world);
  EXPECT_NE(refusal(folder / "b.af.h5").find("look_up"), std::string::npos);
}

TEST(FieldFile, PayloadHashIsTheSameOnEveryRankCount) {
  const test::SharedFolder folder;
  EXPECT_EQ(write(small_field(), folder / "a.af.h5").payload_sha256, kPayloadSha256);
}

TEST(FieldFile, HoldsCodewordsThatAnyReaderOfHdf5Reads) {
  const test::SharedFolder folder;
  write(small_field(), folder / "a.af.h5");
  const hdf5::Handle file = hdf5::open_file(folder / "a.af.h5", H5F_ACC_RDONLY);
  const hdf5::Handle dataset(
      H5Dopen2(file, "/field/slab_1/codewords", H5P_DEFAULT), H5Dclose, "H5Dopen2");
  const std::array<int, 4> tiles = small_field().lattice(1).tile_counts();
  std::vector<std::uint16_t> codewords(
      static_cast<std::size_t>(small_field().lattice(1).tile_count()));
  ASSERT_GE(H5Dread(dataset, H5T_NATIVE_UINT16, H5S_ALL, H5S_ALL, H5P_DEFAULT, codewords.data()),
            0);
  EXPECT_EQ(codewords.back(),
            index_at({tiles[0] - 1, tiles[1] - 1, tiles[2] - 1, tiles[3] - 1}, 1));
  const hdf5::Handle creation(H5Dget_create_plist(dataset), H5Pclose, "H5Dget_create_plist");
  std::vector<H5Z_filter_t> filters;
  for (int i = 0; i < H5Pget_nfilters(creation); ++i) {
    unsigned flags = 0;
    std::size_t none = 0;
    filters.push_back(H5Pget_filter2(
        creation, static_cast<unsigned>(i), &flags, &none, nullptr, 0, nullptr, nullptr));
  }
  EXPECT_EQ(
      filters,
      (std::vector<H5Z_filter_t>{H5Z_FILTER_SHUFFLE, H5Z_FILTER_DEFLATE, H5Z_FILTER_FLETCHER32}));
  Communicator::world().barrier();
}

TEST(FieldFile, MissingBlocksAreNoticedAndLeaveNoFile) {
  const test::SharedFolder folder;
  const Communicator world = Communicator::world();
  const CompressedAttenuationField field = small_field();
  const auto blocks = all_blocks(field);
  // Indices that nobody wrote read as 0, so a block that is not all 0 is left out. Different ranks
  // verify the first slab and the last.
  ASSERT_NE(blocks[3].slab, blocks.back().slab);
  for (const std::size_t missing : {std::size_t{3}, blocks.size() - 1}) {
    auto written = blocks;
    written.erase(written.begin() + static_cast<std::ptrdiff_t>(missing));
    bool is_thrown = false;
    try {
      write_field(field, dealt(written, world), some_provenance(), folder / "a.af.h5", world);
    } catch (const Error& error) {
      is_thrown = error.exit_code() == ExitCode::File;
    }
    EXPECT_TRUE(is_thrown) << missing;
    world.barrier();
    EXPECT_FALSE(std::filesystem::exists(folder / "a.af.h5"));
    EXPECT_FALSE(std::filesystem::exists(folder / "a.af.h5.partial"));
  }
}

TEST(FieldFile, HintsToMpiIoDoNotChangeThePayload) {
  const test::SharedFolder folder;
  const Communicator world = Communicator::world();
  const CompressedAttenuationField field = small_field();
  const std::string expected = write(field, folder / "a.af.h5").payload_sha256;
  const MpiIoHints hints = {{"cb_nodes", "1"}, {"striping_unit", "65536"}, {"no-such-hint", "1"}};
  const FieldFileInfo info = write_field(
      field, dealt(all_blocks(field), world), some_provenance(), folder / "b.af.h5", world, hints);
  EXPECT_EQ(info.payload_sha256, expected);
}

TEST(FieldFile, TheTestOfCollectiveWritesLeavesNothingAndSaysWhatFailed) {
  const test::SharedFolder folder;
  const Communicator world = Communicator::world();
  check_parallel_writing(folder / "a.af.h5", world);
  world.barrier();
  EXPECT_TRUE(std::filesystem::is_empty(folder / ""));
  std::string said;
  try {
    check_parallel_writing("/nowhere/a.af.h5", world);
  } catch (const Error& error) {
    said = error.what();
  }
  EXPECT_NE(said.find("/nowhere/a.af.h5.io-test"), std::string::npos) << said;
  EXPECT_NE(said.find("HDF5 1."), std::string::npos) << said;
}

/// As small_field(), but one slab with one tile, a chunk, for every viewpoint tile.
CompressedAttenuationField field_of_chunks(int tiles_u, int tiles_v) {
  CompressedAttenuationField field = small_field();
  field.light_slab.u.nodes = 2 * tiles_u;
  field.light_slab.v.nodes = 2 * tiles_v;
  field.light_slab.slabs.resize(1);
  field.light_slab.slabs[0].stored_s = {2, 2};
  field.light_slab.slabs[0].stored_t = {4, 2};
  return field;
}

/// The default metadata cache of HDF5 1.10 holds the index of 65536 chunks, and fails beyond.
TEST(FieldFile, HoldsMoreChunksThanFitIntoTheCacheOfHdf5) {
  constexpr int kAlongU = kIndexChunkTilesAlongU;
  constexpr int kTilesU = 288 * kAlongU;
  constexpr int kTilesV = 256;
  const test::SharedFolder folder;
  const Communicator world = Communicator::world();
  const CompressedAttenuationField field = field_of_chunks(kTilesU, kTilesV);
  EXPECT_GT(hdf5::chunk_count(field_layout::index_rules(field)), 65536u);
  std::vector<IndexBlock> blocks;
  for (int first = 0; first < kTilesU; first += kAlongU) {
    blocks.push_back({0, {first, 0, 0, 0}, {kAlongU, kTilesV, 1, 1}, {}});
    for (int a = first; a < first + kAlongU; ++a)
      for (int b = 0; b < kTilesV; ++b) blocks.back().indices.push_back(index_at({a, b, 0, 0}, 0));
  }
  write_field(field, dealt(blocks, world), some_provenance(), folder / "a.af.h5", world);
  const auto read = read_field(folder / "a.af.h5", world);
  std::size_t next = 0;
  for (int a = 0; a < kTilesU; ++a)
    for (int b = 0; b < kTilesV; ++b)
      ASSERT_EQ(read->slabs[0].indices[next++], index_at({a, b, 0, 0}, 0));
}

TEST(FieldFile, TheTestOfManyChunksLeavesNothing) {
  const test::SharedFolder folder;
  const Communicator world = Communicator::world();
  check_writing_many_chunks(
      field_of_chunks(288 * kIndexChunkTilesAlongU, 256).lattice(), folder / "a.af.h5", world);
  // A small field is not tested: writing to this path would fail.
  check_writing_many_chunks(small_field().lattice(), "/nowhere/a.af.h5", world);
  world.barrier();
  EXPECT_TRUE(std::filesystem::is_empty(folder / ""));
  world.barrier();
}

/// Skipped unless AF_LARGE_FIELD_GB says how many GB of indices to write, verify and look up.
/// Looking up needs as much memory on the node. Every unit of 32 viewpoint tiles along u has 1 MiB.
TEST(FieldFile, HoldsALargeField) {
  const char* const gigabytes = std::getenv("AF_LARGE_FIELD_GB");
  if (gigabytes == nullptr) GTEST_SKIP() << "AF_LARGE_FIELD_GB is not set";
  constexpr std::array<int, 4> kTiles = {32, 1, 256, 64};
  constexpr std::size_t kTilesOfUnit = 32u * 256u * 64u;
  const test::SharedFolder folder;
  const Communicator world = Communicator::world();
  const auto units = static_cast<int>(std::stod(gigabytes) * 1e9 / (2.0 * kTilesOfUnit));
  CompressedAttenuationField field = field_of_chunks(kTiles[0], units);
  SlabGeometry& slab = field.light_slab.slabs[0];
  slab.s.nodes = 2 * kTiles[2];
  slab.t.nodes = 2 * kTiles[3];
  slab.stored_s = {0, slab.s.nodes};
  slab.stored_t = {0, slab.t.nodes};
  int next = world.rank();
  const auto next_blocks = [&] {
    std::vector<IndexBlock> blocks;
    for (; next < units && blocks.size() < 8; next += world.size()) {
      blocks.push_back({0, {0, next, 0, 0}, kTiles, std::vector<std::uint16_t>(kTilesOfUnit)});
      for (std::size_t i = 0; i < kTilesOfUnit; i += 16)
        blocks.back().indices[i] =
            static_cast<std::uint16_t>(hash64(kSeed, static_cast<std::uint64_t>(next), i) % 50);
    }
    return blocks;
  };
  const FieldFileInfo info =
      write_field(field, next_blocks, some_provenance, folder / "large.af.h5", world);
  EXPECT_GT(info.payload_bytes, static_cast<std::uint64_t>(std::stod(gigabytes) * 0.99e9));
  // As in af-drr, all of it is read into the node's memory, and every unit is looked up.
  const auto read = read_field(folder / "large.af.h5", world);
  std::uint64_t wrong = 0;
  for (int unit = 0; unit < units; ++unit)
    for (std::size_t u = 0; u < 32; ++u) {
      const std::size_t in_unit = u * 256 * 64 + 16 * (static_cast<std::size_t>(unit) % 64);
      const std::size_t in_slab =
          (u * static_cast<std::size_t>(units) + static_cast<std::size_t>(unit)) * 256 * 64 +
          16 * (static_cast<std::size_t>(unit) % 64);
      const std::uint64_t expected = hash64(kSeed, static_cast<std::uint64_t>(unit), in_unit) % 50;
      wrong += read->slabs[0].indices[in_slab] != expected ? 1u : 0u;
    }
  EXPECT_EQ(wrong, 0u);
}

/// The chunks of fields whose slabs have these tiles.
std::vector<hdf5::ChunkShape> chunks_of(
    const std::vector<std::vector<std::uint64_t>>& extents_of_slabs) {
  std::vector<field_layout::DatasetRule> rules;
  for (const auto& extents : extents_of_slabs) {
    rules.emplace_back();
    rules.back().extents = extents;
  }
  EXPECT_LE(hdf5::chunk_count(rules), hdf5::kMostSmallChunks);
  const auto shapes = hdf5::index_chunks(rules);
  for (std::size_t k = 0; k < shapes.size(); ++k) {
    std::uint64_t elements = 1;
    for (std::size_t axis = 0; axis < 4; ++axis) {
      EXPECT_LE(shapes[k][axis], extents_of_slabs[k][axis]);
      elements *= shapes[k][axis];
    }
    EXPECT_LE(elements, hdf5::kMaxChunkElements);
  }
  return shapes;
}

TEST(FieldFile, ChunksGrowAlongVOnlyWhereThereWouldBeTooMany) {
  using hdf5::ChunkShape;
  EXPECT_EQ(chunks_of({{32, 32, 128, 118}})[0], (ChunkShape{8, 1, 32, 64}));
  // A chunk spans as many planes of equal u as make 32 MiB.
  EXPECT_EQ(chunks_of({{64, 64, 512, 128}})[0], (ChunkShape{4, 1, 32, 64}));
  EXPECT_EQ(chunks_of({{64, 64, 512, 320}})[0], (ChunkShape{1, 1, 32, 64}));
  // Tiles 2 to 4 of 7, or 1 to 3 of 5, surround the nominal viewpoint. One chunk holds them.
  EXPECT_EQ(chunks_of({{7, 7, 144, 102}})[0], (ChunkShape{5, 1, 32, 64}));
  EXPECT_EQ(chunks_of({{5, 4, 3, 7}})[0], (ChunkShape{4, 1, 3, 7}));
  EXPECT_EQ(chunks_of({{2, 4, 3, 7}})[0], (ChunkShape{2, 1, 3, 7}));
  // 2^20 chunks, and one column more.
  EXPECT_EQ(chunks_of({{128, 128, 1024, 512}})[0], (ChunkShape{1, 4, 32, 64}));
  EXPECT_EQ(chunks_of({{128, 128, 1024, 513}})[0], (ChunkShape{1, 8, 32, 64}));
  // The chunks of all slabs count.
  EXPECT_EQ(chunks_of(std::vector(64, std::vector<std::uint64_t>{64, 64, 600, 400}))[63],
            (ChunkShape{1, 64, 32, 64}));
  // A chunk spans no more viewpoints along v than there are, and at most 2^20 elements.
  EXPECT_EQ(chunks_of({{2048, 3, 4096, 2048}})[0], (ChunkShape{1, 3, 256, 64}));
  EXPECT_EQ(chunks_of({{1024, 2048, 1024, 512}})[0], (ChunkShape{1, 512, 32, 64}));
}

TEST(FieldFile, AnUnwritableFolderIsAFileErrorOnEveryRank) {
  const Communicator world = Communicator::world();
  const CompressedAttenuationField field = small_field();
  bool is_thrown = false;
  try {
    write_field(
        field, dealt(all_blocks(field), world), some_provenance(), "/nowhere/a.af.h5", world);
  } catch (const Error& error) {
    is_thrown = error.exit_code() == ExitCode::File;
  }
  EXPECT_TRUE(is_thrown);
}

TEST(FieldFile, RefusesWhatIsNotAField) {
  const test::SharedFolder folder;
  const Communicator world = Communicator::world();
  if (world.is_root()) {
    std::ofstream(folder / "empty");
    std::ofstream(folder / "text") << "not HDF5, whatever it says\n";
    hdf5::create_file(folder / "other.h5");
    std::filesystem::create_directory(folder / "folder");
  }
  world.barrier();
  EXPECT_NE(refusal(folder / "missing").find("does not exist"), std::string::npos);
  EXPECT_NE(refusal(folder / "empty").find("is empty"), std::string::npos);
  EXPECT_NE(refusal(folder / "text").find("not an HDF5 file"), std::string::npos);
  EXPECT_NE(refusal(folder / "folder").find("not a file"), std::string::npos);
  EXPECT_NE(refusal(folder / "other.h5").find("format"), std::string::npos);
}

TEST(FieldFile, RefusesATruncatedFileOfAnyLength) {
  const test::SharedFolder folder;
  const Communicator world = Communicator::world();
  write(small_field(), folder / "a.af.h5");
  const auto size = std::filesystem::file_size(folder / "a.af.h5");
  for (const std::uintmax_t kept :
       {size - 1, size / 2, size / 8, std::uintmax_t{512}, std::uintmax_t{9}}) {
    if (world.is_root()) {
      std::filesystem::copy_file(
          folder / "a.af.h5", folder / "cut", std::filesystem::copy_options::overwrite_existing);
      std::filesystem::resize_file(folder / "cut", kept);
    }
    world.barrier();
    refusal(folder / "cut");
    world.barrier();
  }
}

TEST(FieldFile, ADamagedByteIsRefusedOrWithoutEffect) {
  const test::SharedFolder folder;
  const Communicator world = Communicator::world();
  const FieldFileInfo sound = write(small_field(), folder / "a.af.h5");
  const auto size = std::filesystem::file_size(folder / "a.af.h5");
  int refused = 0;
  constexpr int kDamages = 60;
  for (int i = 0; i < kDamages; ++i) {
    if (world.is_root()) {
      std::filesystem::copy_file(
          folder / "a.af.h5", folder / "bad", std::filesystem::copy_options::overwrite_existing);
      std::fstream file(folder / "bad", std::ios::in | std::ios::out | std::ios::binary);
      const auto position =
          static_cast<std::streamoff>(hash64(kSeed, static_cast<std::uint64_t>(i)) % size);
      file.seekg(position);
      const int byte = file.get();
      file.seekp(position);
      file.put(static_cast<char>(byte ^ 0x55));
    }
    world.barrier();
    try {
      FieldFileInfo info;
      read_field(folder / "bad", world, &info);
      // The byte lay in unused space, in an attribute that no reader uses, or in the provenance.
      EXPECT_EQ(info.payload_sha256, sound.payload_sha256);
    } catch (const Error& error) {
      EXPECT_EQ(error.exit_code(), ExitCode::File) << error.what();
      ++refused;
    }
    world.barrier();
  }
  EXPECT_GT(refused, kDamages / 4);
}

TEST(FieldFile, RefusesAnUnknownVersion) {
  const test::SharedFolder folder;
  write(small_field(), folder / "a.af.h5");
  edit_file(folder / "a.af.h5", [](hid_t file) {
    H5Adelete(file, "format_version");
    hdf5::write_int_attribute(file, "format_version", field_layout::kFormatVersion + 1);
  });
  const std::string message = refusal(folder / "a.af.h5");
  EXPECT_NE(
      message.find("format_version: expected 5 (af-precompute makes the field anew), found 6"),
      std::string::npos)
      << message;
}

TEST(FieldFile, RefusesAMissingDataset) {
  const test::SharedFolder folder;
  for (const char* name :
       {"/codebook/codewords", "/geometry/uv_nodes", "/field/slab_1", "/identity"}) {
    write(small_field(), folder / "a.af.h5");
    edit_file(folder / "a.af.h5", [&](hid_t file) { H5Ldelete(file, name, H5P_DEFAULT); });
    refusal(folder / "a.af.h5");
  }
}

/// Replaces a dataset of a sound file by another of the same name.
void replace(hid_t file, const field_layout::Dataset& dataset) {
  H5Ldelete(file, dataset.rule.name.c_str(), H5P_DEFAULT);
  hdf5::write_dataset(file, dataset, sha256_hex(dataset.bytes));
}

TEST(FieldFile, RefusesAnotherTypeOrExtent) {
  using field_layout::ElementType;
  const test::SharedFolder folder;
  const std::vector<field_layout::DatasetRule> wrong = {
      {"/geometry/uv_nodes", ElementType::Float64, {2}, false, "1", "x"},
      {"/geometry/uv_nodes", ElementType::Int32, {3}, false, "1", "x"},
      {"/geometry/slab_from_ct", ElementType::Float64, {16}, false, "mm", "x"},
      {"/codebook/codewords", ElementType::UInt16, {70000, 16}, false, "level", "x"},
      {"/codebook/codewords", ElementType::UInt16, {50, 15}, false, "level", "x"},
      {"/identity/camera_name", ElementType::Int32, {1}, false, "1", "x"},
      {"/identity/camera_name", ElementType::Text, {5000}, false, "1", "x"},
      {"/field/slab_0/codewords", ElementType::UInt16, {4, 3, 10, 7}, false, "codeword", "x"},
      {"/field/slab_0/codewords", ElementType::Int32, {4, 3, 10, 6}, false, "codeword", "x"}};
  for (const auto& rule : wrong) {
    write(small_field(), folder / "a.af.h5");
    edit_file(folder / "a.af.h5", [&](hid_t file) {
      std::size_t bytes = field_layout::element_bytes(rule.type);
      for (const std::uint64_t extent : rule.extents) bytes *= extent;
      replace(file, {rule, std::vector<std::byte>(bytes)});
    });
    const std::string message = refusal(folder / "a.af.h5");
    EXPECT_NE(message.find(rule.name), std::string::npos) << message;
  }
}

/// A field whose `name` was replaced by what `make` creates.
std::string refusal_with(const std::filesystem::path& path,
                         const std::string& name,
                         const std::function<void(hid_t file, const char* name)>& make) {
  write(small_field(), path);
  edit_file(path, [&](hid_t file) {
    H5Ldelete(file, name.c_str(), H5P_DEFAULT);
    make(file, name.c_str());
  });
  return refusal(path);
}

TEST(FieldFile, RefusesLinks) {
  const test::SharedFolder folder;
  write(small_field(), folder / "other.af.h5");
  for (const char* name : {"/geometry/uv_nodes", "/identity", "/field/slab_1"}) {
    std::string message =
        refusal_with(folder / "a.af.h5", name, [](hid_t file, const char* to_make) {
          H5Lcreate_external("other.af.h5", to_make, file, to_make, H5P_DEFAULT, H5P_DEFAULT);
        });
    EXPECT_NE(message.find("found a link"), std::string::npos) << message;
    message = refusal_with(folder / "a.af.h5", name, [](hid_t file, const char* to_make) {
      H5Lcreate_soft("/codebook", file, to_make, H5P_DEFAULT, H5P_DEFAULT);
    });
    EXPECT_NE(message.find("found a link"), std::string::npos) << message;
  }
}

TEST(FieldFile, RefusesContentsElsewhereAndFiltersOfPlugIns) {
  const test::SharedFolder folder;
  const auto refusal_of = [&](const std::function<void(hid_t creation, hid_t space)>& set) {
    return refusal_with(
        folder / "a.af.h5", "/geometry/uv_nodes", [&](hid_t file, const char* name) {
          const std::array<hsize_t, 1> extents = {2};
          const hdf5::Handle space(
              H5Screate_simple(1, extents.data(), nullptr), H5Sclose, "H5Screate_simple");
          const hdf5::Handle creation(H5Pcreate(H5P_DATASET_CREATE), H5Pclose, "H5Pcreate");
          set(creation, space);
          const hdf5::Handle dataset(
              H5Dcreate2(file, name, H5T_STD_I32LE, space, H5P_DEFAULT, creation, H5P_DEFAULT),
              H5Dclose,
              "H5Dcreate2");
        });
  };
  const std::string external = refusal_of(
      [](hid_t creation, hid_t) { H5Pset_external(creation, "/etc/hostname", 0, H5F_UNLIMITED); });
  EXPECT_NE(external.find("those of another"), std::string::npos) << external;
  const std::string mapped = refusal_of([](hid_t creation, hid_t space) {
    H5Pset_virtual(creation, space, "other.af.h5", "/geometry/uv_nodes", space);
  });
  EXPECT_NE(mapped.find("those of another"), std::string::npos) << mapped;
  const std::string filtered = refusal_of([](hid_t creation, hid_t) {
    const std::array<hsize_t, 1> chunk = {2};
    H5Pset_chunk(creation, 1, chunk.data());
    H5Pset_nbit(creation);
  });
  EXPECT_NE(filtered.find("filters deflate"), std::string::npos) << filtered;
}

TEST(FieldFile, RefusesChunksOfMoreThanAMillionElements) {
  const test::SharedFolder folder;
  const auto refusal_of = [&](const std::vector<hsize_t>& chunk) {
    return refusal_with(
        folder / "a.af.h5", "/geometry/uv_nodes", [&](hid_t file, const char* name) {
          // A chunk may be larger than its dataset only where the dataset may grow.
          const auto rank = static_cast<int>(chunk.size());
          const std::vector<hsize_t> extents(chunk.size(), 2);
          const std::vector<hsize_t> limits(chunk.size(), H5S_UNLIMITED);
          const hdf5::Handle space(
              H5Screate_simple(rank, extents.data(), limits.data()), H5Sclose, "H5Screate_simple");
          const hdf5::Handle creation(H5Pcreate(H5P_DATASET_CREATE), H5Pclose, "H5Pcreate");
          H5Pset_chunk(creation, rank, chunk.data());
          const hdf5::Handle dataset(
              H5Dcreate2(file, name, H5T_STD_I32LE, space, H5P_DEFAULT, creation, H5P_DEFAULT),
              H5Dclose,
              "H5Dcreate2");
        });
  };
  constexpr hsize_t kMost = 1u << 20;
  for (const std::vector<hsize_t>& chunk :
       {std::vector<hsize_t>{kMost + 1}, {1u << 11, 1u << 10}, {1, 1, kMost + 1}}) {
    const std::string message = refusal_of(chunk);
    EXPECT_NE(message.find("/geometry/uv_nodes"), std::string::npos) << message;
    EXPECT_NE(message.find("chunks of at most 1048576 elements"), std::string::npos) << message;
  }
  // At the limit the chunk passes. The file is refused all the same, because the dataset is empty.
  const std::string message = refusal_of({kMost});
  EXPECT_EQ(message.find("chunks"), std::string::npos) << message;
}

TEST(FieldFile, RefusesACameraNameThatIsAPath) {
  const test::SharedFolder folder;
  CompressedAttenuationField field = small_field();
  field.identity.camera.name = "../AP";
  write(field, folder / "a.af.h5");
  EXPECT_NE(refusal(folder / "a.af.h5").find("camera_name"), std::string::npos);
}

TEST(FieldFile, RefusesAChangedValueWhoseOwnHashWasMended) {
  const test::SharedFolder folder;
  CompressedAttenuationField other = small_field();
  other.light_slab.u.first_mm -= 1.0;
  write(small_field(), folder / "a.af.h5");
  edit_file(folder / "a.af.h5", [&](hid_t file) {
    for (const auto& dataset : field_layout::datasets_of(other))
      if (dataset.rule.name == "/geometry/u_extent_mm") replace(file, dataset);
  });
  EXPECT_NE(refusal(folder / "a.af.h5").find("payload_sha256"), std::string::npos);
}

TEST(FieldFile, RefusesContentsThatMakeNoSenseThoughAllHashesAgree) {
  const test::SharedFolder folder;
  const auto refusal_of = [&](const std::function<void(CompressedAttenuationField&)>& spoil) {
    CompressedAttenuationField field = small_field();
    spoil(field);
    write(field, folder / "a.af.h5");
    return refusal(folder / "a.af.h5");
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinity = std::numeric_limits<double>::infinity();
  refusal_of([&](auto& field) { field.light_slab.u.first_mm = nan; });
  refusal_of([&](auto& field) { field.light_slab.slabs[1].s.last_mm = infinity; });
  refusal_of([&](auto& field) { field.light_slab.slabs[1].y_low_mm = nan; });
  refusal_of([&](auto& field) { field.light_slab.slab_from_ct.matrix()(0, 0) = 2.0; });
  refusal_of([&](auto& field) { field.identity.camera.source_point.x() = nan; });
  refusal_of([&](auto& field) { field.identity.camera.size_px.x() = -4; });
  refusal_of([&](auto& field) { field.identity.frame.rotation(0, 0) = -1.0; });
  refusal_of([&](auto& field) { field.identity.range = {-1.0, 100.0}; });
  refusal_of([&](auto& field) { field.identity.mu_water_per_mm = 0.0; });
  refusal_of([&](auto& field) { field.quantizer_step = 0.0f; });
  refusal_of([&](auto& field) { field.quantizer_step = std::numeric_limits<float>::quiet_NaN(); });
  refusal_of(
      [&](auto& field) { std::swap(field.codebook.codewords[1], field.codebook.codewords[9]); });
  refusal_of([&](auto& field) { field.codebook.codewords[0][3] = 1; });
  const std::string message = refusal_of([&](auto& field) { field.codebook.codewords.resize(20); });
  EXPECT_NE(message.find("an index beyond the 20 codewords"), std::string::npos) << message;
}

/// small_field() with means: of codewords 1 to 49, 96 times the index.
CompressedAttenuationField field_with_means() {
  CompressedAttenuationField field = small_field();
  field.codebook.mean_step = 48;
  for (std::size_t i = 1; i < field.codebook.size(); ++i)
    for (std::size_t k = 0; k < kTileElements; ++k)
      field.codebook.codewords[i][k] =
          static_cast<std::uint16_t>(kShapeZero + ((k & 2u) == 0 ? -1 : 1) * 3 * (25 - int(i)));
  return field;
}

std::vector<IndexBlock> blocks_with_means(const CompressedAttenuationField& field) {
  std::vector<IndexBlock> blocks = all_blocks(field);
  for (IndexBlock& block : blocks) {
    const auto row = static_cast<std::size_t>(block.tile_count[3]);
    std::vector<std::uint16_t> values;
    for (std::size_t at = 0; at < block.indices.size(); at += row) {
      const auto indices = std::span(block.indices).subspan(at, row);
      values.insert(values.end(), indices.begin(), indices.end());
      for (const std::uint16_t index : indices)
        values.push_back(static_cast<std::uint16_t>(96 * index));
    }
    block.indices = std::move(values);
  }
  return blocks;
}

/// Means of more tiles along t than kMeanRunTiles, so that a second run of differences begins.
TEST(FieldFile, HoldsMeansBesideTheIndices) {
  const test::SharedFolder folder;
  const Communicator world = Communicator::world();
  CompressedAttenuationField field = field_with_means();
  SlabGeometry& slab = field.light_slab.slabs[0];
  slab.t.nodes = 6 * kMeanRunTiles;
  slab.stored_t = {0, 5 * kMeanRunTiles};
  const auto path = folder / "a.af.h5";
  std::vector<IndexBlock> blocks = blocks_with_means(field);
  write_field(field, dealt(blocks, world), some_provenance(), path, world);
  const auto read = read_field(path, world);
  EXPECT_EQ(read->codebook.mean_step, 48);
  EXPECT_EQ(read->codebook.codewords, field.codebook.codewords);
  EXPECT_EQ(read_field_header(path).codebook.mean_step, 48);
  for (std::size_t k = 0; k < 2; ++k) {
    const std::array<int, 4> tiles = read->lattice(k).tile_counts();
    std::size_t next = 0;
    for (int a = 0; a < tiles[0]; ++a)
      for (int b = 0; b < tiles[1]; ++b)
        for (int c = 0; c < tiles[2]; ++c) {
          for (int d = 0; d < tiles[3]; ++d)
            ASSERT_EQ(read->slabs[k].indices[next++], index_at({a, b, c, d}, k));
          for (int d = 0; d < tiles[3]; ++d)
            ASSERT_EQ(read->slabs[k].indices[next++], 96 * index_at({a, b, c, d}, k));
        }
  }
  // As the format says: in the order [u][v][t][s], with runs of differences along t.
  const hdf5::Handle file = hdf5::open_file(path, H5F_ACC_RDONLY);
  const hdf5::Handle dataset(
      H5Dopen2(file, "/field/slab_0/means", H5P_DEFAULT), H5Dclose, "H5Dopen2");
  const std::array<int, 4> tiles = read->lattice(0).tile_counts();
  std::vector<std::uint16_t> means(read->slabs[0].indices.size() / 2);
  ASSERT_GE(H5Dread(dataset, H5T_NATIVE_UINT16, H5S_ALL, H5S_ALL, H5P_DEFAULT, means.data()), 0);
  ASSERT_GT(tiles[3], kMeanRunTiles);
  for (int d = 0; d < tiles[3]; ++d) {
    const int before = d % kMeanRunTiles == 0 ? 0 : 96 * index_at({0, 0, 1, d - 1}, 0);
    EXPECT_EQ(means[static_cast<std::size_t>(d * tiles[2] + 1)],
              static_cast<std::uint16_t>(96 * index_at({0, 0, 1, d}, 0) - before));
  }
  world.barrier();
}

TileFilter some_filter() {
  TileFilter filter;
  for (std::size_t j = 0; j < kTileElements; ++j)
    for (std::size_t i = 0; i < kFilterInputs; ++i)
      filter.weights[j][i] = 0.01f * static_cast<float>(j) - 0.003f * static_cast<float>(i);
  return filter;
}

TEST(FieldFile, HoldsAFilterBesideTheCodebook) {
  const test::SharedFolder folder;
  const Communicator world = Communicator::world();
  for (const bool has_means : {false, true}) {
    CompressedAttenuationField field = has_means ? field_with_means() : small_field();
    field.codebook.filter = some_filter();
    const auto blocks = has_means ? blocks_with_means(field) : all_blocks(field);
    const auto path = folder / "a.af.h5";
    test::remove_shared_file(path);
    write_field(field, dealt(blocks, world), some_provenance(), path, world);
    const auto read = read_field(path, world);
    EXPECT_EQ(read->codebook.mean_step, field.codebook.mean_step);
    EXPECT_EQ(read->codebook.codewords, field.codebook.codewords);
    EXPECT_EQ(read->codebook.filter, field.codebook.filter);
    EXPECT_EQ(read_field_header(path).codebook.filter, field.codebook.filter);
  }
}

TEST(FieldFile, RefusesAFilterThatIsNoneOrNotStated) {
  const test::SharedFolder folder;
  const Communicator world = Communicator::world();
  CompressedAttenuationField field = small_field();
  const auto write = [&](const TileFilter& filter) {
    field.codebook.filter = filter;
    test::remove_shared_file(folder / "a.af.h5");
    write_field(
        field, dealt(all_blocks(field), world), some_provenance(), folder / "a.af.h5", world);
  };
  const auto expect_refused = [&](const std::string& text) {
    const std::string message = refusal(folder / "a.af.h5");
    EXPECT_NE(message.find(text), std::string::npos) << message;
  };
  TileFilter filter = some_filter();
  filter.weights[3][4] = std::numeric_limits<float>::quiet_NaN();
  write(filter);
  expect_refused("tile_filter");
  filter.weights[3][4] = std::numeric_limits<float>::infinity();
  write(filter);
  expect_refused("tile_filter: weights must be within 1e6 of 0");
  // Without the filter, a reader would use the tiles unfiltered.
  write(some_filter());
  edit_file(folder / "a.af.h5",
            [](hid_t file) { H5Ldelete(file, "/codebook/tile_filter", H5P_DEFAULT); });
  expect_refused("payload_sha256");
}

TEST(FieldFile, RefusesMeansThatMakeNoSense) {
  const test::SharedFolder folder;
  const Communicator world = Communicator::world();
  const auto refusal_of =
      [&](const std::function<void(CompressedAttenuationField&, std::vector<IndexBlock>&)>& spoil) {
        CompressedAttenuationField field = field_with_means();
        std::vector<IndexBlock> blocks = blocks_with_means(field);
        spoil(field, blocks);
        test::remove_shared_file(folder / "a.af.h5");
        write_field(field, dealt(blocks, world), some_provenance(), folder / "a.af.h5", world);
        return refusal(folder / "a.af.h5");
      };
  const auto expect_named = [](const std::string& message, const std::string& text) {
    EXPECT_NE(message.find(text), std::string::npos) << message;
  };
  // The index is spoilt within the second row of the first block.
  expect_named(refusal_of([](auto&, auto& blocks) {
                 auto& block = blocks.front();
                 block.indices[static_cast<std::size_t>(block.tile_count[3])] = 97;
               }),
               "means are multiples of 48");
  expect_named(refusal_of([](auto&, auto& blocks) { blocks.front().indices[0] = 50; }),
               "an index beyond the 50 codewords");
  expect_named(refusal_of([](auto& field, auto&) { field.codebook.mean_step = 100000; }),
               "mean_step = 100000");
  expect_named(refusal_of([](auto& field, auto&) {
                 std::swap(field.codebook.codewords[3], field.codebook.codewords[9]);
               }),
               "breaks the codebook's order");
}

/// Asymmetric, with a symmetric part of 0.1 rad and 5 mm.
MotionRange range_of_bounds() {
  MotionRange range(0.1, 5.0);
  range.low.rotation_rad.z() = -0.5;
  range.high.translation_mm.y() = 40.0;
  return range;
}

TEST(FieldFile, HoldsARangeOfBoundsBesideItsSymmetricPart) {
  const test::SharedFolder folder;
  CompressedAttenuationField field = small_field();
  field.identity.range = {0.1, 5.0};
  const std::string symmetric = write(field, folder / "a.af.h5").payload_sha256;
  field.identity.range = range_of_bounds();
  // The payload states only the symmetric part, so it equals that of a field with this symmetric
  // range.
  EXPECT_EQ(write(field, folder / "b.af.h5").payload_sha256, symmetric);
  FieldFileInfo info;
  const auto read = read_field(folder / "b.af.h5", Communicator::world(), &info);
  EXPECT_EQ(read->identity.range.low.rotation_rad, field.identity.range.low.rotation_rad);
  EXPECT_EQ(read->identity.range.high.rotation_rad, field.identity.range.high.rotation_rad);
  EXPECT_EQ(read->identity.range.low.translation_mm, field.identity.range.low.translation_mm);
  EXPECT_EQ(read->identity.range.high.translation_mm, field.identity.range.high.translation_mm);
  EXPECT_EQ(read_field_header(folder / "b.af.h5").identity.range.low.rotation_rad.z(), -0.5);
  EXPECT_TRUE(read_field(folder / "a.af.h5", Communicator::world())->identity.range.is_symmetric());
  // The bounds are gone, as after a tool that copies only what it knows.
  edit_file(folder / "b.af.h5", [&](hid_t file) { H5Ldelete(file, "/range", H5P_DEFAULT); });
  EXPECT_EQ(read_field_header(folder / "b.af.h5").identity.range.max_rotation_rad(), 0.1);
}

TEST(FieldFile, SaysThatItIsOfBoneAloneBesideThePayload) {
  const test::SharedFolder folder;
  CompressedAttenuationField field = small_field();
  const std::string of_all = write(field, folder / "a.af.h5").payload_sha256;
  field.identity.material = FieldMaterial::Bone;
  EXPECT_EQ(write(field, folder / "a.bone.af.h5").payload_sha256, of_all);
  const auto& world = Communicator::world();
  const auto all = read_field(folder / "a.af.h5", world);
  EXPECT_EQ(all->identity.material, FieldMaterial::All);
  EXPECT_EQ(read_field_header(folder / "a.bone.af.h5").identity.material, FieldMaterial::Bone);
  const auto bone = read_field_of_any_material(bone_field_path(folder / "a.af.h5"), world);
  EXPECT_EQ(bone->identity.material, FieldMaterial::Bone);
  // FileError where it is thrown, RemoteError on the other ranks.
  EXPECT_THROW(read_field(folder / "a.bone.af.h5", world), Error);
  const auto is_of = [&](const FieldIdentity& wanted, const FieldIdentity& found) {
    require_bone_of(wanted, found, "a.bone.af.h5");
  };
  EXPECT_NO_THROW(is_of(all->identity, bone->identity));
  EXPECT_THROW(is_of(all->identity, all->identity), FileError);
  FieldIdentity other = all->identity;
  other.mu_water_per_mm = 0.019;
  EXPECT_THROW(is_of(other, bone->identity), FileError);
  other = all->identity;
  other.ct.content_sha256 = std::string(64, 'b');
  EXPECT_THROW(is_of(other, bone->identity), FileError);
  other = all->identity;
  other.ct.grid.spacing_mm *= 1.1;
  EXPECT_THROW(is_of(other, bone->identity), FileError);
}

TEST(FieldFile, OfBoneStandsBesideTheFieldOfAll) {
  EXPECT_EQ(bone_field_path("a/A.af.h5"), "a/A.bone.af.h5");
  EXPECT_EQ(bone_field_path("A.h5"), "A.bone.h5");
  EXPECT_EQ(bone_field_path("field"), "field.bone");
}

TEST(FieldFile, RefusesBoundsThatContradictThePayload) {
  const test::SharedFolder folder;
  CompressedAttenuationField field = small_field();
  field.identity.range = range_of_bounds();
  write(field, folder / "a.af.h5");
  MotionRange wider = range_of_bounds();
  wider.low.rotation_rad = Eigen::Vector3d::Constant(-0.7);
  wider.high.rotation_rad = Eigen::Vector3d::Constant(0.7);
  edit_file(folder / "a.af.h5", [&](hid_t file) {
    for (const auto& dataset : field_layout::range_datasets(wider)) replace(file, dataset);
  });
  EXPECT_NE(refusal(folder / "a.af.h5").find("/range"), std::string::npos);
}

TEST(FieldFile, RefusesHugeExtentsBeforeItAsksForMemory) {
  const test::SharedFolder folder;
  const Communicator world = Communicator::world();
  CompressedAttenuationField huge = small_field();
  huge.light_slab.u.nodes = huge.light_slab.v.nodes = 65536;
  SlabGeometry& slab = huge.light_slab.slabs[0];
  slab.s.nodes = slab.t.nodes = 65536;
  slab.stored_s = slab.stored_t = {0, 65536};
  write(small_field(), folder / "a.af.h5");
  edit_file(folder / "a.af.h5", [&](hid_t file) {
    for (const auto& dataset : field_layout::datasets_of(huge)) replace(file, dataset);
  });
  const std::string message = refusal(folder / "a.af.h5");
  EXPECT_NE(message.find("a file of"), std::string::npos) << message;
  // Counts whose product would overflow, or that are negative.
  for (const std::array<int, 2>& nodes : {std::array{2000000000, 2000000000}, {-6, 24}, {1, 24}}) {
    CompressedAttenuationField odd = small_field();
    odd.light_slab.slabs[0].s.nodes = nodes[0];
    odd.light_slab.slabs[0].stored_s.count = nodes[1];
    edit_file(folder / "a.af.h5", [&](hid_t file) {
      for (const auto& dataset : field_layout::datasets_of(odd)) replace(file, dataset);
    });
    refusal(folder / "a.af.h5");
  }
  world.barrier();
}

}  // namespace
}  // namespace af
