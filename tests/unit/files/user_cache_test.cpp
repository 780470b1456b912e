// SPDX-License-Identifier: Apache-2.0
#include "files/user_cache.h"

#include <array>
#include <cstdlib>
#include <filesystem>
#include <sys/wait.h>
#include <unistd.h>

#include <gtest/gtest.h>

#include "files/output_file.h"
#include "support/io_checks.h"
#include "support/own_cache.h"

namespace af {
namespace {

namespace fs = std::filesystem;
using test::OwnCache;
using Numbers = std::vector<double>;

const std::string kKey = "0a1b";

TEST(UserCache, FindsWhatWasKeptLast) {
  const OwnCache cache;
  EXPECT_EQ(cached<Numbers>(kKey), std::nullopt);
  keep_in_cache(kKey, Numbers{1.0, 2.5});
  keep_in_cache("another", Numbers{7.0});
  EXPECT_EQ(cached<Numbers>(kKey), (Numbers{1.0, 2.5}));
  keep_in_cache(kKey, Numbers{3.0});
  EXPECT_EQ(cached<Numbers>(kKey), Numbers{3.0});
  EXPECT_EQ(cache.entries().size(), 2U);
  fs::remove_all(cache.folder());
  EXPECT_EQ(cached<Numbers>(kKey), std::nullopt);
}

TEST(UserCache, FindsNothingInAnEntryThatIsDamagedOrOfAnotherKeyOrType) {
  const OwnCache cache;
  keep_in_cache(kKey, Numbers{1.0, 2.5});
  const fs::path entry = cache.folder() / kKey;
  const std::string whole = read_own_text_file(entry);
  for (std::size_t i = 0; i < whole.size(); ++i) {
    std::string damaged = whole;
    damaged[i] = static_cast<char>(damaged[i] ^ 1);
    test::write_input(entry, damaged);
    EXPECT_EQ(cached<Numbers>(kKey), std::nullopt) << i;
    test::write_input(entry, whole.substr(0, i));
    EXPECT_EQ(cached<Numbers>(kKey), std::nullopt) << i;
  }
  test::write_input(entry, whole + "x");
  EXPECT_EQ(cached<Numbers>(kKey), std::nullopt);
  test::write_input(cache.folder() / "another", whole);
  EXPECT_EQ(cached<Numbers>("another"), std::nullopt);
  test::write_input(entry, whole);
  EXPECT_EQ(cached<Numbers>(kKey), (Numbers{1.0, 2.5}));
  EXPECT_EQ(cached<int>(kKey), std::nullopt);
}

TEST(UserCache, TrustsNoFolderThatOthersMayEnter) {
  const OwnCache cache;
  keep_in_cache(kKey, Numbers{1.0});
  EXPECT_EQ(fs::status(cache.folder()).permissions(), fs::perms::owner_all);
  for (const fs::perms others : {fs::perms::group_write, fs::perms::others_read}) {
    fs::permissions(cache.folder(), fs::perms::owner_all | others);
    EXPECT_EQ(cached<Numbers>(kKey), std::nullopt);
    keep_in_cache("another", Numbers{2.0});
  }
  fs::permissions(cache.folder(), fs::perms::owner_all);
  EXPECT_EQ(cached<Numbers>(kKey), Numbers{1.0});
  EXPECT_EQ(cached<Numbers>("another"), std::nullopt);
}

TEST(UserCache, KeepsNothingAndSaysNothingWhereItCannotWrite) {
  const OwnCache cache;
  const test::ScratchFolder folder;
  test::write_input(folder / "a file", "x");
  OwnCache::use(folder / "a file");
  keep_in_cache(kKey, Numbers{1.0});
  EXPECT_EQ(cached<Numbers>(kKey), std::nullopt);
  OwnCache::use(cache.folder().parent_path());
  fs::create_directories(cache.folder() / kKey);
  keep_in_cache(kKey, Numbers{1.0});
  EXPECT_EQ(cached<Numbers>(kKey), std::nullopt);
}

TEST(UserCache, StandsBelowTheHomeFolderWhereNoAbsolutePathIsGiven) {
  const OwnCache cache;
  const test::ScratchFolder home;
  const std::string own_home = std::getenv("HOME") == nullptr ? "" : std::getenv("HOME");
  for (const char* no_folder : {"", "relative"}) {
    OwnCache::use(no_folder);
    setenv("HOME", home.path().c_str(), 1);
    keep_in_cache(kKey, Numbers{1.0});
    EXPECT_TRUE(fs::exists(home / ".cache/attenuation-fields" / kKey));
    EXPECT_EQ(cached<Numbers>(kKey), Numbers{1.0});
    unsetenv("HOME");
    keep_in_cache(kKey, Numbers{1.0});
    EXPECT_EQ(cached<Numbers>(kKey), std::nullopt);
    EXPECT_FALSE(fs::exists("relative"));
    fs::remove_all(home / ".cache");
  }
  if (!own_home.empty()) setenv("HOME", own_home.c_str(), 1);
}

TEST(UserCache, IsWholeWhenProcessesWriteItAtOnce) {
  constexpr int kWrites = 10;
  constexpr std::size_t kNumbers = 5000;
  const OwnCache cache;
  keep_in_cache(kKey, Numbers(kNumbers, 0.0));
  std::array<pid_t, 3> writers{};
  for (pid_t& writer : writers) {
    writer = fork();
    if (writer != 0) continue;
    // Whatever a read finds, one writer wrote it whole, so its numbers are all alike.
    const Numbers own(kNumbers, static_cast<double>(getpid()));
    for (int i = 0; i < kWrites; ++i) {
      keep_in_cache(kKey, own);
      const std::optional<Numbers> found = cached<Numbers>(kKey);
      if (!found || found->empty() || *found != Numbers(kNumbers, found->front())) _exit(1);
    }
    _exit(0);
  }
  for (const pid_t writer : writers) {
    int status = -1;
    ASSERT_EQ(waitpid(writer, &status, 0), writer);
    EXPECT_EQ(status, 0);
  }
  EXPECT_NE(cached<Numbers>(kKey)->front(), 0.0);
  EXPECT_EQ(cache.entries().size(), 1U);
}

}  // namespace
}  // namespace af
