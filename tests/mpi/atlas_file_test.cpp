// SPDX-License-Identifier: Apache-2.0
#include <atomic>
#include <filesystem>
#include <fstream>
#include <functional>
#include <thread>

#include <gtest/gtest.h>

#include "base/error.h"
#include "base/hash_random.h"
#include "drr/field_coverage.h"
#include "drr/field_renderer.h"
#include "drr/opened_field.h"
#include "field/field_layout.h"
#include "field/field_reading.h"
#include "field/field_writing.h"
#include "field/hdf5_calls.h"
#include "files/sha256.h"
#include "support/c_arm_camera.h"
#include "support/shared_folder.h"

namespace af {
namespace {

constexpr std::uint64_t kAtlasSeed = 7;
constexpr std::size_t kCodewords = 40;

/// Two members of one and of two slabs, for cameras that look along y and along x.
AttenuationAtlas small_atlas() {
  AttenuationAtlas atlas;
  atlas.identity.camera = test::c_arm_camera(31, 31, 10.0);
  atlas.identity.range = {0.1, 10.0};
  atlas.identity.ct.content_sha256 = std::string(64, 'a');
  atlas.quantizer_step = 0.00390625f;
  for (std::uint16_t i = 0; i < kCodewords; ++i) {
    Tile tile{};
    tile.fill(static_cast<std::uint16_t>(3 * i));
    atlas.codebook.codewords.push_back(tile);
  }
  AtlasMember member{atlas.identity, {}};
  LightSlab& planes = member.light_slab;
  planes.slab_from_ct = slab_from_ct_at_nominal(member.identity.camera, member.identity.frame);
  planes.uv_plane_y_mm = 650.0;
  planes.u = {-280.0, 280.0, 7};
  planes.v = {-270.0, 270.0, 6};
  SlabGeometry slab;
  slab.s = {-260.0, 250.0, 21};
  slab.t = {-240.0, 230.0, 24};
  slab.stored_s = {2, 19};
  slab.stored_t = {4, 12};
  planes.slabs.push_back(slab);
  atlas.members.push_back(member);
  member.identity.camera.name = "LAT";
  member.identity.camera.source_point = {650.0, 0.0, 0.0};
  member.identity.camera.detector_origin_point = {-370.0, -150.0, 150.0};
  member.identity.camera.column_direction = {0.0, 1.0, 0.0};
  member.identity.range.high.rotation_rad.z() = 0.3;
  planes.slabs[0].y_high_mm = 5.0;
  slab.y_low_mm = 5.0;
  slab.st_plane_y_mm = 20.0;
  slab.stored_s = {0, 4};
  planes.slabs.push_back(slab);
  planes.slab_from_ct = slab_from_ct_at_nominal(member.identity.camera, member.identity.frame);
  atlas.members.push_back(member);
  return atlas;
}

std::uint16_t index_of(std::size_t slab, std::size_t tile) {
  return static_cast<std::uint16_t>(hash64(kAtlasSeed, slab, tile) % kCodewords);
}

/// One block per slab, dealt out over the ranks. The last of several ranks has none.
std::vector<IndexBlock> my_blocks(const AttenuationAtlas& atlas, const Communicator& world) {
  const FieldLattice lattice = atlas.lattice();
  const std::size_t writers = static_cast<std::size_t>(std::max(1, world.size() - 1));
  std::vector<IndexBlock> blocks;
  for (std::size_t k = 0; k < lattice.slabs.size(); ++k) {
    if (k % writers != static_cast<std::size_t>(world.rank())) continue;
    blocks.push_back({k, {0, 0, 0, 0}, lattice.slabs[k].tile_counts(), {}});
    for (std::int64_t i = 0; i < lattice.slabs[k].tile_count(); ++i)
      blocks.back().indices.push_back(index_of(k, static_cast<std::size_t>(i)));
  }
  return blocks;
}

FieldFileInfo write(const AttenuationAtlas& atlas, const std::filesystem::path& path) {
  const Communicator world = Communicator::world();
  test::remove_shared_file(path);
  std::vector<IndexBlock> left = my_blocks(atlas, world);
  return write_atlas(
      atlas,
      [&] { return std::exchange(left, {}); },
      [] {
        return FieldProvenance{"0.1.0", "af-precompute", "look_up = \"cubic\"\n", "{}"};
      },
      path,
      world);
}

void edit(const std::filesystem::path& path, const std::function<void(hid_t)>& change) {
  const Communicator world = Communicator::world();
  if (world.is_root()) {
    const hdf5::Handle file = hdf5::open_file(path, H5F_ACC_RDWR);
    change(file);
  }
  world.barrier();
}

void replace_dataset(hid_t file, const field_layout::Dataset& dataset) {
  H5Ldelete(file, dataset.rule.name.c_str(), H5P_DEFAULT);
  hdf5::write_dataset(file, dataset, sha256_hex(dataset.bytes));
}

/// The message of the FileError that `read` throws on this rank. Without one the test fails.
std::string refusal_of(const std::function<void()>& read) {
  try {
    read();
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::File) << error.what();
    return error.what();
  }
  ADD_FAILURE() << "was read";
  return "";
}

std::string refusal(const std::filesystem::path& path) {
  return refusal_of([&] { read_atlas(path, Communicator::world()); });
}

/// Of small_atlas(). Frozen: made by these tests on one rank.
constexpr const char* kAtlasSha256 =
    "4e4837614f8de5dbd4d9993ecd773fbe5e4b6c618c31d82dab85c2b62baf463f";

TEST(AtlasFile, ReadsBackWhatRanksWroteTogetherMemberByMember) {
  const test::SharedFolder folder;
  const Communicator world = Communicator::world();
  const AttenuationAtlas atlas = small_atlas();
  const FieldFileInfo written = write(atlas, folder / "a.h5");
  EXPECT_EQ(written.payload_sha256, kAtlasSha256);
  EXPECT_TRUE(is_atlas_file(folder / "a.h5"));
  FieldFileInfo info;
  const auto read = read_atlas(folder / "a.h5", world, &info);
  EXPECT_EQ(info.payload_sha256, written.payload_sha256);
  EXPECT_EQ(info.payload_bytes, written.payload_bytes);
  EXPECT_EQ(info.look_up, "cubic");
  EXPECT_EQ(read->codebook.codewords, atlas.codebook.codewords);
  EXPECT_EQ(read->quantizer_step, atlas.quantizer_step);
  EXPECT_EQ(read->identity.camera.name, "AP");
  ASSERT_EQ(read->members.size(), 2u);
  EXPECT_EQ(read->members[1].identity.camera.source_point, Eigen::Vector3d(650.0, 0.0, 0.0));
  EXPECT_EQ(read->members[1].identity.range.high.rotation_rad.z(), 0.3);
  EXPECT_EQ(read->members[1].light_slab.slabs[1].y_low_mm, 5.0);
  std::size_t slab = 0;
  for (std::size_t i = 0; i < 2; ++i) {
    const auto member = read_atlas_member(folder / "a.h5", i, info.payload_sha256, world);
    EXPECT_EQ(member->light_slab.slab_from_ct.matrix(),
              atlas.members[i].light_slab.slab_from_ct.matrix());
    EXPECT_EQ(member->codebook.codewords, atlas.codebook.codewords);
    for (const CompressedSlab& of_member : member->slabs) {
      for (std::size_t t = 0; t < of_member.indices.view().size(); ++t)
        ASSERT_EQ(of_member.indices[t], index_of(slab, t)) << "slab " << slab << ", tile " << t;
      ++slab;
    }
  }
  EXPECT_EQ(slab, 3u);
}

TEST(AtlasFile, ThreadsReadMembersAtTheSameTime) {
  const test::SharedFolder folder;
  const std::string sha256 = write(small_atlas(), folder / "a.h5").payload_sha256;
  std::atomic<int> right = 0;
  std::vector<std::thread> threads;
  for (std::size_t i = 0; i < 4; ++i)
    threads.emplace_back([&, i] {
      const auto member = read_atlas_member(folder / "a.h5", i % 2, sha256, Communicator::alone());
      if (member->slabs[0].indices[3] == index_of(i % 2, 3)) ++right;
    });
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(right, 4);
  Communicator::world().barrier();
}

TEST(AtlasFile, IsNoFieldNorAFieldAnAtlas) {
  const test::SharedFolder folder;
  const Communicator world = Communicator::world();
  write(small_atlas(), folder / "a.h5");
  const std::string message = refusal_of([&] { read_field(folder / "a.h5", world); });
  EXPECT_NE(message.find("expected attenuation-field, found attenuation-atlas"), std::string::npos)
      << message;
  // Files cut at any length, and files that never were an atlas.
  const auto size = std::filesystem::file_size(folder / "a.h5");
  for (const std::uintmax_t kept : {size - 1, size / 2, size / 8, std::uintmax_t{9}}) {
    if (world.is_root()) {
      std::filesystem::copy_file(
          folder / "a.h5", folder / "cut", std::filesystem::copy_options::overwrite_existing);
      std::filesystem::resize_file(folder / "cut", kept);
    }
    world.barrier();
    refusal(folder / "cut");
    world.barrier();
  }
  EXPECT_NE(refusal(folder / "missing").find("does not exist"), std::string::npos);
}

TEST(AtlasFile, RefusesAMissingMemberAndADamagedOne) {
  const test::SharedFolder folder;
  for (const char* name : {"/member_1",
                           "/member_0/geometry/uv_nodes",
                           "/member_1/field/slab_1",
                           "/member_count",
                           "/identity",
                           "/codebook/codewords"}) {
    write(small_atlas(), folder / "a.h5");
    edit(folder / "a.h5", [&](hid_t file) { H5Ldelete(file, name, H5P_DEFAULT); });
    const std::string message = refusal(folder / "a.h5");
    EXPECT_NE(message.find("a.h5"), std::string::npos) << message;
  }
  // A count that differs from the number of members.
  for (const int count : {0, 1, 3, 65}) {
    write(small_atlas(), folder / "a.h5");
    edit(folder / "a.h5", [&](hid_t file) {
      field_layout::Dataset dataset{field_layout::member_count_rule(), {}};
      const auto bytes = std::as_bytes(std::span(&count, 1));
      dataset.bytes.assign(bytes.begin(), bytes.end());
      replace_dataset(file, dataset);
    });
    refusal(folder / "a.h5");
  }
}

TEST(AtlasFile, RefusesACodebookThatIsNotItsOwn) {
  const test::SharedFolder folder;
  AttenuationAtlas other = small_atlas();
  for (std::size_t i = 1; i < other.codebook.size(); ++i) other.codebook.codewords[i][5] += 1;
  write(small_atlas(), folder / "a.h5");
  edit(folder / "a.h5", [&](hid_t file) {
    for (const auto& dataset : field_layout::datasets_of(other))
      if (dataset.rule.name == "/codebook/codewords") replace_dataset(file, dataset);
  });
  EXPECT_NE(refusal(folder / "a.h5").find("payload_sha256"), std::string::npos);
  // A file with too few codewords for its indices, although all hashes agree.
  AttenuationAtlas few = small_atlas();
  few.codebook.codewords.resize(3);
  const std::string sha256 = write(few, folder / "b.h5").payload_sha256;
  const std::string message =
      refusal_of([&] { read_atlas_member(folder / "b.h5", 0, sha256, Communicator::world()); });
  EXPECT_NE(message.find("/member_0/field/slab_0 has an index beyond the 3 codewords"),
            std::string::npos)
      << message;
}

TEST(AtlasFile, RefusesMembersOfAnotherCt) {
  const test::SharedFolder folder;
  AttenuationAtlas atlas = small_atlas();
  atlas.members[1].identity.ct.content_sha256 = std::string(64, 'b');
  write(atlas, folder / "a.h5");
  EXPECT_NE(refusal(folder / "a.h5").find("/member_1: CT of the field"), std::string::npos);
  atlas = small_atlas();
  atlas.members[1].identity.ct.grid.origin_mm.z() += 7.0;
  write(atlas, folder / "a.h5");
  EXPECT_NE(refusal(folder / "a.h5").find("7 mm off"), std::string::npos);
  atlas = small_atlas();
  atlas.members[0].identity.mu_water_per_mm = 0.03;
  write(atlas, folder / "a.h5");
  EXPECT_NE(refusal(folder / "a.h5").find("/member_0/identity"), std::string::npos);
}

TEST(AtlasFile, IsOfBoneAloneWhereAllItsMembersAre) {
  const test::SharedFolder folder;
  const Communicator world = Communicator::world();
  AttenuationAtlas atlas = small_atlas();
  const std::string of_all = write(atlas, folder / "a.h5").payload_sha256;
  for (AtlasMember& member : atlas.members) member.identity.material = FieldMaterial::Bone;
  const std::string of_bone = write(atlas, folder / "a.bone.h5").payload_sha256;
  EXPECT_EQ(of_bone, of_all);
  EXPECT_EQ(read_atlas(folder / "a.bone.h5", world)->identity.material, FieldMaterial::Bone);
  EXPECT_EQ(read_atlas_member(folder / "a.bone.h5", 1, of_bone, world)->identity.material,
            FieldMaterial::Bone);
  // FileError where it is thrown, RemoteError on the other ranks.
  EXPECT_THROW(OpenedField(folder / "a.bone.h5", world), Error);
  const OpenedField opened(folder / "a.h5", world);
  EXPECT_EQ(opened.bone(world).info().payload_sha256, of_bone);
  EXPECT_THROW(opened.bone(world).bone(world), Error);  // a.bone.bone.h5
  atlas.members[1].identity.material = FieldMaterial::All;
  write(atlas, folder / "a.h5");
  EXPECT_NE(refusal(folder / "a.h5").find("/member_1/material"), std::string::npos);
  world.barrier();  // rank 0 removes the folder
}

TEST(AtlasFile, RefusesAMemberOfAFileThatHasBecomeAnother) {
  const test::SharedFolder folder;
  const Communicator world = Communicator::world();
  const std::string before = write(small_atlas(), folder / "a.h5").payload_sha256;
  AttenuationAtlas other = small_atlas();
  other.members[0].light_slab.u.first_mm -= 1.0;
  write(other, folder / "a.h5");
  const std::string message =
      refusal_of([&] { read_atlas_member(folder / "a.h5", 0, before, world); });
  EXPECT_NE(message.find("payload_sha256"), std::string::npos) << message;
}

TEST(OpenedField, LooksAnAtlasUpInTheMemberThatHoldsAPose) {
  const test::SharedFolder folder;
  const Communicator world = Communicator::world();
  write(small_atlas(), folder / "a.h5");
  const OpenedField opened(folder / "a.h5", world);
  EXPECT_EQ(opened.field(), nullptr);
  ASSERT_EQ(opened.coverage().planes.size(), 2u);
  const auto renderer = opened.renderer("quadrilinear");
  const RigidTransform nominal = RigidTransform::Identity();
  const View ap = View::whole_detector(opened.identity().camera);
  EXPECT_EQ(renderer->rays_outside(nominal, ap), 0);
  EXPECT_EQ(opened.coverage().rays_outside(nominal, ap), 0);
  const auto member = opened.member(0, Communicator::alone());
  const auto alone = make_field_renderer(member, "quadrilinear");
  EXPECT_EQ(render_image(*renderer, nominal, ap).pixels, render_image(*alone, nominal, ap).pixels);
  const HeldRays held = read_held_rays(folder / "a.h5");
  EXPECT_EQ(held.coverage.rays_outside(nominal, ap), 0);
  EXPECT_EQ(held.coverage.distance_text(ap.camera),
            "atlas of 2 fields, the nearest of AP: the nominal camera");
  const MotionRange box = held.coverage.box(ap, held.identity.frame, held.identity.range);
  EXPECT_GT(box.max_translation_mm(), 1.0);
  world.barrier();  // rank 0 removes the folder
}

}  // namespace
}  // namespace af
