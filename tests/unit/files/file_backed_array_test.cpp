// SPDX-License-Identifier: Apache-2.0
#include "files/file_backed_array.h"

#include <cstdint>
#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "support/test_paths.h"

namespace af {
namespace {

TEST(FileBackedArray, KeepsWhatItHoldsWhenItGrows) {
  const test::ScratchFolder folder;
  FileBackedArray<std::int64_t> array(folder.path());
  EXPECT_TRUE(array.view().empty());
  std::size_t count = 0;
  for (const std::size_t more : {1u, 3u, 0u, 5000u, 100'000u}) {
    for (std::int64_t& value : array.append(more)) {
      EXPECT_EQ(value, 0);
      value = static_cast<std::int64_t>(count++);
    }
    ASSERT_EQ(array.view().size(), count);
  }
  for (std::size_t i = 0; i < count; ++i) ASSERT_EQ(array.view()[i], static_cast<std::int64_t>(i));
  EXPECT_TRUE(std::filesystem::is_empty(folder.path())) << "its file has a name";
}

TEST(FileBackedArray, OfNothingNeedsNoFolder) {
  FileBackedArray<int> array("/no/such/folder");
  EXPECT_TRUE(array.append(0).empty());
  EXPECT_TRUE(array.view().empty());
}

TEST(FileBackedArray, RefusesWhatTheDiskCannotHold) {
  const test::ScratchFolder folder;
  FileBackedArray<std::int64_t> array(folder.path());
  array.append(1)[0] = 7;
  constexpr std::size_t kTooMany = std::size_t{1} << 56;
  try {
    array.append(kTooMany);
    ADD_FAILURE() << "was given";
  } catch (const FileError& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr(folder.path().string()));
    EXPECT_THAT(error.what(), testing::HasSubstr("no room for"));
  }
  ASSERT_EQ(array.view().size(), 1u);
  EXPECT_EQ(array.view()[0], 7);
  EXPECT_THROW(FileBackedArray<int>("/no/such/folder").append(1), FileError);
}

}  // namespace
}  // namespace af
