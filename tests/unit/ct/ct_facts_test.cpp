// SPDX-License-Identifier: Apache-2.0
#include "ct/ct_facts.h"

#include <filesystem>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/stored_bytes.h"
#include "ct/ct_reader.h"
#include "files/input_guard.h"
#include "files/output_file.h"
#include "support/io_checks.h"
#include "support/own_cache.h"
#include "unit/ct/ct_test_data.h"

namespace af {
namespace {

namespace fs = std::filesystem;
using test::asymmetric_ct;
using test::OwnCache;
using test::small_grid;
using testing::ElementsAre;
using testing::HasSubstr;

/// What read_ct_facts() says of a CT.
struct Told {
  CtFacts facts;
  std::vector<std::string> warnings;
};

Told told_of(const fs::path& path,
             const CtReadOptions& options = {},
             const AttenuationModel& model = {}) {
  Told told;
  told.facts = read_ct_facts(path, options, model, told.warnings);
  return told;
}

void expect_same(const Told& expected, const Told& found) {
  EXPECT_EQ(bytes_of(found.facts), bytes_of(expected.facts));
  EXPECT_EQ(found.warnings, expected.warnings);
}

/// MetaImage with its voxels in a file of their own, without the patient's orientation.
fs::path write_header_and_voxels(const fs::path& folder) {
  const CtVolume ct = asymmetric_ct(small_grid());
  const auto voxels = std::as_bytes(ct.hu.view());
  test::write_input(folder / "ct.mhd",
                    "ObjectType = Image\nNDims = 3\nDimSize = 7 6 5\nElementType = MET_SHORT\n"
                    "ElementSpacing = 0.8 0.9 1.5\nElementDataFile = ct.raw\n");
  test::write_input(folder / "ct.raw",
                    std::string(reinterpret_cast<const char*>(voxels.data()), voxels.size()));
  return folder / "ct.mhd";
}

/// The CT in files of each kind.
std::vector<fs::path> written(const fs::path& folder) {
  const CtVolume ct = asymmetric_ct(small_grid());
  std::vector<fs::path> paths = {folder / "ct.nii.gz", folder / "ct.mha", folder / "ct.nrrd"};
  for (const fs::path& path : paths) write_ct(ct, path);
  test::write_dicom_series(ct, folder / "dicom");
  paths.push_back(folder / "dicom");
  paths.push_back(write_header_and_voxels(folder));
  return paths;
}

/// Changes one byte of a file and keeps its length.
void change_byte(const fs::path& path, std::size_t place) {
  std::string bytes = read_own_text_file(path);
  ASSERT_LT(place, bytes.size());
  bytes[place] = static_cast<char>(bytes[place] ^ 1);
  test::write_input(path, bytes);
}

TEST(CtFacts, AreTheSameWhetherTheCtIsKnownOrNot) {
  const test::ScratchFolder folder;
  for (const fs::path& path : written(folder.path())) {
    SCOPED_TRACE(path.filename());
    const OwnCache cache;
    const Told first = told_of(path);
    const auto entries = cache.entries();
    EXPECT_EQ(entries.size(), 1U);
    EXPECT_EQ(ct_difference(identity_of(read_ct(path)), first.facts.identity), "");
    EXPECT_EQ(first.facts.grid.size, small_grid().size);
    EXPECT_FALSE(first.facts.cut_points_ct.empty());
    expect_same(first, told_of(path));
    EXPECT_EQ(cache.entries(), entries) << "the CT was read again";
  }
}

TEST(CtFacts, WarnEachTime) {
  const OwnCache cache;
  const test::ScratchFolder folder;
  const fs::path path = write_header_and_voxels(folder.path());
  std::ofstream(folder / "ct.raw", std::ios::app) << "surplus";
  const Told first = told_of(path);
  EXPECT_THAT(first.warnings,
              ElementsAre(HasSubstr("7 bytes more than the header says"),
                          HasSubstr("no patient orientation")));
  expect_same(first, told_of(path));
  EXPECT_EQ(cache.entries().size(), 1U);
}

TEST(CtFacts, AreReadAnewWhenAByteOfAnyFileChanges) {
  const OwnCache cache;
  const test::ScratchFolder folder;
  written(folder.path());
  const auto hash_of = [&](const std::string& name) {
    return told_of(folder / name).facts.identity.content_sha256;
  };
  const std::string hash = hash_of("ct.mhd");
  change_byte(folder / "ct.raw", 200);
  EXPECT_NE(hash_of("ct.mhd"), hash);
  EXPECT_EQ(hash_of("dicom"), hash);
  const fs::path slice = *fs::directory_iterator(folder / "dicom");
  change_byte(slice, fs::file_size(slice) - 20);
  EXPECT_NE(hash_of("dicom"), hash);
  // A warning names a file that is not a slice.
  test::write_input(folder / "dicom/notes.txt", "none");
  EXPECT_THAT(told_of(folder / "dicom").warnings, ElementsAre(HasSubstr("notes.txt")));
  EXPECT_EQ(cache.entries().size(), 5U);
}

TEST(CtFacts, TellWhereTheVoxelsLieNow) {
  const OwnCache cache;
  const test::ScratchFolder folder;
  CtVolume ct = asymmetric_ct(small_grid());
  const CtIdentity identity = identity_of(ct);
  for (const char* name : {"ct.mha", "ct.nii.gz", "ct.nrrd"}) {
    SCOPED_TRACE(name);
    write_ct(ct, folder / name);
    EXPECT_EQ(ct_difference(identity, told_of(folder / name).facts.identity), "");
    CtVolume moved = ct;
    moved.grid.origin_mm.x() += 7.0;
    write_ct(moved, folder / name);
    const CtIdentity found = told_of(folder / name).facts.identity;
    EXPECT_EQ(found.content_sha256, identity.content_sha256);
    EXPECT_THAT(ct_difference(identity, found), HasSubstr("7 mm off"));
  }
}

TEST(CtFacts, AreOfTheWayInWhichTheCtIsRead) {
  const OwnCache cache;
  const test::ScratchFolder folder;
  const fs::path path = folder / "ct.mha";
  write_ct(asymmetric_ct(small_grid()), path);
  const Told as_hu = told_of(path);
  CtReadOptions raw;
  raw.values = "raw";
  raw.raw_slope_per_mm = 1e-5;
  raw.raw_offset_per_mm = 0.02;
  const Told as_raw = told_of(path, raw);
  EXPECT_NE(as_raw.facts.identity.content_sha256, as_hu.facts.identity.content_sha256);
  CtReadOptions other_water = raw;
  other_water.values_water_mu_per_mm = 0.021;
  EXPECT_NE(told_of(path, other_water).facts.identity.content_sha256,
            as_raw.facts.identity.content_sha256);
  CtReadOptions resampled;
  resampled.resamples = true;
  expect_same(as_hu, told_of(path, resampled));
  (void)told_of(path, {}, {.mu_water_per_mm = 0.02, .air_below_hu = 0});
  EXPECT_EQ(cache.entries().size(), 5U);
  expect_same(as_hu, told_of(path));
  expect_same(as_raw, told_of(path, raw));
}

TEST(CtFacts, AreReadAnewWhenTheEntryIsDamaged) {
  const OwnCache cache;
  const test::ScratchFolder folder;
  const fs::path path = folder / "ct.nrrd";
  write_ct(asymmetric_ct(small_grid()), path);
  const Told first = told_of(path);
  ASSERT_EQ(cache.entries().size(), 1U);
  const fs::path entry = cache.folder() / cache.entries().begin()->first;
  const std::string whole = read_own_text_file(entry);
  change_byte(entry, whole.size() / 2);
  expect_same(first, told_of(path));
  EXPECT_EQ(read_own_text_file(entry), whole);
}

TEST(CtFacts, OfAKnownCtKeepItsFilesFromBeingReplaced) {
  const OwnCache cache;
  const test::ScratchFolder folder;
  std::vector<fs::path> files = {write_header_and_voxels(folder.path()), folder / "ct.raw"};
  test::write_dicom_series(asymmetric_ct(small_grid()), folder / "dicom");
  for (const auto& slice : fs::directory_iterator(folder / "dicom")) files.push_back(slice);
  const auto look = [&] {
    (void)told_of(folder / "ct.mhd");
    (void)told_of(folder / "dicom");
  };
  look();
  // The same bytes in new files: what was noted about the old files does not hold for them.
  for (const fs::path& file : files) {
    fs::copy_file(file, folder / "copy");
    fs::rename(folder / "copy", file);
    EXPECT_NO_THROW(refuse_input(file)) << file;
  }
  const auto entries = cache.entries();
  look();
  EXPECT_EQ(cache.entries(), entries) << "the CT was read again";
  for (const fs::path& file : files) EXPECT_THROW(refuse_input(file), InputError) << file;
}

TEST(CtFacts, NeedNoCache) {
  const OwnCache cache;
  const test::ScratchFolder folder;
  const fs::path path = folder / "ct.nii.gz";
  write_ct(asymmetric_ct(small_grid()), path);
  const Told with_cache = told_of(path);
  test::write_input(folder / "a file", "x");
  OwnCache::use(folder / "a file");
  expect_same(with_cache, told_of(path));
  expect_same(with_cache, told_of(path));
}

TEST(CtFacts, AreRefusedAsTheCtIs) {
  const OwnCache cache;
  const test::ScratchFolder folder;
  test::write_input(folder / "text", "no CT");
  CtVolume air = asymmetric_ct(small_grid());
  air.hu = SharedArray<std::int16_t>(std::vector<std::int16_t>(air.grid.voxel_count(), -1000));
  write_ct(air, folder / "air.mha");
  fs::create_directory(folder / "empty");
  for (const char* name : {"text", "air.mha", "empty", "absent"}) {
    const auto refusal_by = [](const auto& read) -> std::string {
      try {
        read();
      } catch (const Error& error) {
        return error.what();
      }
      return "";
    };
    const std::string expected = refusal_by([&] { (void)read_ct(folder / name); });
    EXPECT_NE(expected, "") << name;
    EXPECT_EQ(refusal_by([&] { (void)told_of(folder / name); }), expected);
  }
  EXPECT_TRUE(cache.entries().empty());
}

}  // namespace
}  // namespace af
