// SPDX-License-Identifier: Apache-2.0
#include "files/partial_folder.h"

#include <fstream>

#include <gtest/gtest.h>

#include "base/error.h"
#include "support/test_paths.h"

namespace af {
namespace {

namespace fs = std::filesystem;

void write_file(const fs::path& path) {
  std::ofstream(path) << "x";
}

TEST(PartialFolder, AppearsUnderItsNameOnlyWhenCommitted) {
  const test::ScratchFolder scratch;
  PartialFolder folder((scratch / "deep") / "study/", PartialFolder::Existing::Refuse);
  write_file(folder.path() / "a");
  EXPECT_FALSE(fs::exists(scratch / "deep" / "study"));
  EXPECT_TRUE(fs::exists(scratch / "deep" / "study.partial" / "a"));
  folder.commit();
  EXPECT_TRUE(fs::exists(scratch / "deep" / "study" / "a"));
  EXPECT_FALSE(fs::exists(scratch / "deep" / "study.partial"));
}

TEST(PartialFolder, LeavesNothingWhenAbandoned) {
  const test::ScratchFolder scratch;
  {
    const PartialFolder folder(scratch / "study", PartialFolder::Existing::Refuse);
    write_file(folder.path() / "a");
  }
  EXPECT_TRUE(fs::is_empty(scratch.path()));
}

TEST(PartialFolder, RemovesWhatAKilledRunLeft) {
  const test::ScratchFolder scratch;
  fs::create_directories(scratch / "study.partial");
  write_file(scratch / "study.partial" / "old");
  PartialFolder folder(scratch / "study", PartialFolder::Existing::Refuse);
  EXPECT_TRUE(fs::is_empty(folder.path()));
}

TEST(PartialFolder, RefusesAFolderWithContentAndAFile) {
  const test::ScratchFolder scratch;
  fs::create_directories(scratch / "study");
  write_file(scratch / "study" / "mine");
  write_file(scratch / "file");
  EXPECT_THROW(PartialFolder(scratch / "study", PartialFolder::Existing::Refuse), InputError);
  EXPECT_THROW(PartialFolder(scratch / "file", PartialFolder::Existing::Replace), InputError);
  EXPECT_TRUE(fs::exists(scratch / "study" / "mine"));
  EXPECT_FALSE(fs::exists(scratch / "study.partial"));
}

TEST(PartialFolder, TakesAnEmptyFolder) {
  const test::ScratchFolder scratch;
  fs::create_directories(scratch / "study");
  PartialFolder folder(scratch / "study", PartialFolder::Existing::Refuse);
  write_file(folder.path() / "a");
  folder.commit();
  EXPECT_TRUE(fs::exists(scratch / "study" / "a"));
}

TEST(PartialFolder, ReplacesAnOldFolderOnlyOnCommit) {
  const test::ScratchFolder scratch;
  fs::create_directories(scratch / "study");
  write_file(scratch / "study" / "old");
  PartialFolder folder(scratch / "study", PartialFolder::Existing::Replace);
  write_file(folder.path() / "new");
  EXPECT_TRUE(fs::exists(scratch / "study" / "old"));
  folder.commit();
  EXPECT_TRUE(fs::exists(scratch / "study" / "new"));
  EXPECT_FALSE(fs::exists(scratch / "study" / "old"));
  EXPECT_FALSE(fs::exists(scratch / "study.old"));
}

TEST(PartialFolder, ReportsAFolderThatCannotBeMade) {
  const test::ScratchFolder scratch;
  write_file(scratch / "file");
  EXPECT_THROW(PartialFolder(scratch / "file" / "study", PartialFolder::Existing::Refuse), Error);
}

}  // namespace
}  // namespace af
