// SPDX-License-Identifier: Apache-2.0
#include "files/output_file.h"

#include <fstream>
#include <sys/stat.h>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "files/input_file.h"
#include "support/file_size_limit.h"
#include "support/io_checks.h"

namespace af {
namespace {

namespace fs = std::filesystem;
using test::FileSizeLimit;
using test::message_of;
using test::ScratchFolder;
using testing::AllOf;
using testing::HasSubstr;

std::size_t entry_count(const fs::path& folder) {
  return static_cast<std::size_t>(
      std::distance(fs::directory_iterator(folder), fs::directory_iterator()));
}

TEST(WriteAtomically, KeepsTheExtensionOfThePartialFileLast) {
  const ScratchFolder folder;
  const std::vector<std::pair<std::string, std::string>> names = {{"a.mha", "a.partial.mha"},
                                                                  {"a.nii.gz", "a.partial.nii.gz"},
                                                                  {"A.af.h5", "A.af.partial.h5"},
                                                                  {"plain", "plain.partial"},
                                                                  {".hidden", ".hidden.partial"},
                                                                  {"x.gz", "x.partial.gz"}};
  for (const auto& [name, partial_name] : names) {
    fs::path seen;
    write_atomically(folder / name, [&seen](const fs::path& partial) {
      seen = partial;
      std::ofstream(partial) << "content";
    });
    EXPECT_EQ(seen, folder / partial_name);
    EXPECT_EQ(read_text_file(folder / name), "content");
  }
  EXPECT_EQ(entry_count(folder.path()), names.size());
}

TEST(WriteAtomically, FileIsAbsentWhileItIsBeingWritten) {
  const ScratchFolder folder;
  write_atomically(folder / "a.txt", [&](const fs::path& partial) {
    std::ofstream(partial) << "half";
    EXPECT_FALSE(fs::exists(folder / "a.txt"));
  });
  EXPECT_TRUE(fs::exists(folder / "a.txt"));
}

TEST(WriteAtomically, FailingWriterLeavesNothingAndKeepsTheOldFile) {
  const ScratchFolder folder;
  write_text_file(folder / "a.txt", "old");
  EXPECT_THROW(write_atomically(folder / "a.txt",
                                [](const fs::path& partial) {
                                  std::ofstream(partial) << "half of the new";
                                  throw NumericError("stopped");
                                }),
               NumericError);
  EXPECT_EQ(read_text_file(folder / "a.txt"), "old");
  EXPECT_EQ(entry_count(folder.path()), 1U);
}

TEST(WriteAtomically, WriterThatMakesNoFileIsAnError) {
  const ScratchFolder folder;
  EXPECT_THROW(write_atomically(folder / "a.txt", [](const fs::path&) {}), FileError);
  EXPECT_EQ(entry_count(folder.path()), 0U);
}

TEST(WriteAtomically, SystemErrorsOfTheWriterNameThePath) {
  const ScratchFolder folder;
  const std::string message = message_of<FileError>([&] {
    write_atomically(folder / "a.txt",
                     [](const fs::path& partial) { fs::resize_file(partial, 10); });
  });
  EXPECT_THAT(message, AllOf(HasSubstr(folder / "a.txt"), HasSubstr("No such file")));
}

TEST(WriteAtomically, ReplacesAStalePartialFile) {
  const ScratchFolder folder;
  std::ofstream(folder / "a.partial.txt") << "left by a killed run, and longer";
  write_text_file(folder / "a.txt", "new");
  EXPECT_EQ(read_text_file(folder / "a.txt"), "new");
  EXPECT_EQ(entry_count(folder.path()), 1U);
}

TEST(WriteAtomically, RefusesAMissingFolderByName) {
  const ScratchFolder folder;
  const std::string message =
      message_of<FileError>([&] { write_text_file(folder / "missing/a.txt", "x"); });
  EXPECT_THAT(message, AllOf(HasSubstr(folder / "missing"), HasSubstr("does not exist")));
  EXPECT_EQ(entry_count(folder.path()), 0U);
}

TEST(WriteAtomically, RefusesToReplaceAFolderOrADevice) {
  const ScratchFolder folder;
  fs::create_directory(folder / "a.txt");
  EXPECT_THROW(write_text_file(folder / "a.txt", "x"), FileError);
  ASSERT_EQ(mkfifo((folder / "pipe").c_str(), 0600), 0);
  EXPECT_THROW(write_text_file(folder / "pipe", "x"), FileError);
  EXPECT_TRUE(fs::is_fifo(folder / "pipe"));
  EXPECT_THROW(write_text_file("", "x"), FileError);
  EXPECT_THROW(write_text_file(folder.path() / "", "x"), FileError);
  std::ofstream(folder / "file").close();
  EXPECT_THROW(write_text_file(folder / "file/a.txt", "x"), FileError);
}

TEST(WriteTextFile, FullDiskNamesTheReasonAndLeavesNothing) {
  const ScratchFolder folder;
  const std::string text(100'000, 'x');
  const std::string message = message_of<FileError>([&] {
    const FileSizeLimit limit(1000);
    write_text_file(folder / "a.txt", text);
  });
  EXPECT_THAT(message, HasSubstr("File too large"));
  EXPECT_EQ(entry_count(folder.path()), 0U);
}

TEST(WriteTextFile, KeepsEveryByte) {
  const ScratchFolder folder;
  std::string text;
  for (int i = 0; i < 100'000; ++i) text.push_back(static_cast<char>(i % 256));
  write_text_file(folder / "a", text);
  EXPECT_EQ(read_text_file(folder / "a"), text);
}

TEST(ReadTextFile, RefusesMissingFilesFoldersAndFilesBeyondTheLimit) {
  const ScratchFolder folder;
  EXPECT_THAT(message_of<FileError>([&] { read_text_file(folder / "missing"); }),
              HasSubstr("does not exist"));
  EXPECT_THAT(message_of<FileError>([&] { read_text_file(folder.path()); }),
              HasSubstr("is a folder"));
  write_text_file(folder / "a", "12345");
  EXPECT_EQ(read_text_file(folder / "a", 5), "12345");
  EXPECT_THROW(read_text_file(folder / "a", 4), FileError);
  EXPECT_THAT(message_of<FileError>([] { read_text_file("/dev/zero", 1000); }),
              HasSubstr("is a device"));
}

TEST(InputFile, IsARegularFileAndNothingIsWaitedFor) {
  const ScratchFolder folder;
  write_text_file(folder / "a", "12345");
  fs::create_symlink("a", folder / "link");
  EXPECT_EQ(read_text_file(folder / "link"), "12345");
  ASSERT_EQ(mkfifo((folder / "pipe").c_str(), 0600), 0);
  fs::create_symlink("loop", folder / "loop");
  const auto message_for = [](const std::string& path) {
    return message_of<FileError>([&] { (void)open_input_file(path); });
  };
  EXPECT_THAT(message_for(folder / "pipe"), HasSubstr("is a pipe"));
  EXPECT_THAT(message_for(folder / "loop"), HasSubstr("Too many levels of symbolic links"));
  EXPECT_THAT(message_for(folder / std::string(303, 'x')), HasSubstr("File name too long"));
  EXPECT_THAT(message_for(folder / "a/b"), HasSubstr("does not exist"));
  EXPECT_THAT(message_for(folder.path()), HasSubstr("is a folder"));
}

TEST(MakeFolder, MakesParentsAndAcceptsAnExistingFolder) {
  const ScratchFolder folder;
  make_folder(folder / "a/b/c");
  make_folder(folder / "a/b/c");
  EXPECT_TRUE(fs::is_directory(folder / "a/b/c"));
  EXPECT_EQ(entry_count(folder / "a/b/c"), 0U);
}

TEST(MakeFolder, RefusesAFileInItsPlace) {
  const ScratchFolder folder;
  write_text_file(folder / "a", "x");
  EXPECT_THROW(make_folder(folder / "a"), FileError);
  EXPECT_THROW(make_folder(folder / "a/b"), FileError);
  EXPECT_THROW(make_folder(""), FileError);
}

}  // namespace
}  // namespace af
