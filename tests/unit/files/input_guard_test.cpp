// SPDX-License-Identifier: Apache-2.0
#include "files/input_guard.h"

#include <sys/stat.h>
#include <sys/sysmacros.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "files/csv_table.h"
#include "files/output_file.h"
#include "files/partial_folder.h"
#include "support/io_checks.h"

namespace af {
namespace {

namespace fs = std::filesystem;
using test::message_of;
using test::ScratchFolder;
using testing::AllOf;
using testing::HasSubstr;

TEST(InputGuard, AnInputIsNotOverwrittenByAnyOfItsNames) {
  const ScratchFolder folder;
  test::write_input(folder / "in.txt", "precious");
  fs::create_hard_link(folder / "in.txt", folder / "hard.txt");
  fs::create_symlink(folder / "in.txt", folder / "soft.txt");
  fs::create_directory_symlink(folder.path(), folder / "way");
  EXPECT_EQ(read_text_file(folder / "in.txt"), "precious");
  for (const fs::path name : {"in.txt", "hard.txt", "soft.txt", "way/in.txt", "./in.txt"})
    EXPECT_THAT(message_of<InputError>([&] { write_text_file(folder / name, "lost"); }),
                AllOf(HasSubstr(folder / name), HasSubstr(folder / "in.txt")));
  EXPECT_THROW(remove_output(folder / "hard.txt"), InputError);
  EXPECT_EQ(read_text_file(folder / "in.txt"), "precious");
}

TEST(InputGuard, AnUnfinishedFileMustNotBeAnInputEither) {
  const ScratchFolder folder;
  test::write_input(folder / "a.partial.txt", "precious");
  EXPECT_EQ(read_text_file(folder / "a.partial.txt"), "precious");
  EXPECT_THROW(write_text_file(folder / "a.txt", "new"), InputError);
  EXPECT_TRUE(fs::exists(folder / "a.partial.txt"));
}

TEST(InputGuard, TablesReadInPartsAreInputs) {
  const ScratchFolder folder;
  test::write_input(folder / "in.csv", "a\n1\n");
  CsvTable::read_in_parts(folder / "in.csv", [](const CsvTable&) {});
  EXPECT_THROW(write_text_file(folder / "in.csv", "lost"), InputError);
}

TEST(InputGuard, AnAnnouncedOutputIsRefusedAsInput) {
  const ScratchFolder folder;
  test::write_input(folder / "both.txt", "precious");
  fs::create_symlink(folder / "both.txt", folder / "link.txt");
  announce_output(folder / "link.txt");
  EXPECT_THROW((void)read_text_file(folder / "both.txt"), InputError);
  test::write_input(folder / "summary.json", "precious");
  announce_outputs(folder.path(), {"summary.json", "other.csv"});
  EXPECT_THROW((void)read_text_file(folder / "summary.json"), InputError);
}

TEST(InputGuard, WhatTheProgramWroteItMayReadAndWriteAgain) {
  const ScratchFolder folder;
  for (const char* text : {"one", "two"}) {
    write_text_file(folder / "mine.txt", text);
    EXPECT_EQ(read_text_file(folder / "mine.txt"), text);
  }
}

TEST(InputGuard, AFolderThatHoldsAnInputIsNotReplaced) {
  const ScratchFolder folder;
  for (const char* name : {"study", "study.partial", "study.old"}) {
    fs::create_directory(folder / name);
    const fs::path input = folder / name / "ct.mha";
    test::write_input(input, "precious");
    // Read before the folder is opened for writing ...
    EXPECT_EQ(read_text_file(input), "precious");
    EXPECT_THROW(PartialFolder(folder / "study", PartialFolder::Existing::Replace), InputError);
    EXPECT_TRUE(fs::exists(input));
    fs::remove_all(folder / name);
  }
  fs::create_directory(folder / "later");
  test::write_input(folder / "later/ct.mha", "precious");
  const PartialFolder later(folder / "later", PartialFolder::Existing::Replace);
  // ... or after it.
  EXPECT_THROW((void)read_text_file(folder / "later/ct.mha"), InputError);
}

TEST(OutputFile, NothingButAFileIsReplaced) {
  const ScratchFolder folder;
  ASSERT_EQ(mkfifo((folder / "pipe").c_str(), 0600), 0);
  fs::create_directory(folder / "folder");
  fs::create_symlink(folder / "pipe", folder / "link");
  fs::create_symlink(folder / "nowhere", folder / "dangling");
  // Making a device may need root; elsewhere a pipe stands in for it.
  const bool has_device = mknod((folder / "device").c_str(), S_IFCHR | 0600, makedev(1, 3)) == 0;
  for (const char* name : {"pipe", "folder", "link", "dangling", "device"}) {
    if (!has_device && std::string(name) == "device") continue;
    const fs::path path = folder / name;
    const fs::file_type type = fs::symlink_status(path).type();
    EXPECT_THROW(announce_output(path), FileError) << name;
    EXPECT_THROW(write_text_file(path, "x"), FileError) << name;
    test::write_input(folder / "whole", "x");
    EXPECT_THROW(move_into_place(folder / "whole", path), FileError) << name;
    EXPECT_EQ(fs::symlink_status(path).type(), type) << name;
  }
  EXPECT_THROW(announce_outputs(folder / "pipe", {}), FileError);
  announce_outputs(folder / "absent", {"a.txt"});
}

}  // namespace
}  // namespace af
