// SPDX-License-Identifier: Apache-2.0
#include "ranks/resumable_items.h"

#include <array>
#include <csignal>
#include <cstring>
#include <filesystem>
#include <map>
#include <numeric>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "ranks/stop_request.h"
#include "support/shared_folder.h"

namespace af::cli {
namespace {

const DecidingValues kDecides = {{"seed", "1"}};

std::vector<std::int64_t> first_items(std::int64_t count) {
  std::vector<std::int64_t> items(static_cast<std::size_t>(count));
  std::iota(items.begin(), items.end(), 0);
  return items;
}

/// The item's number modulo 100 gives the count of bytes; each holds its lowest 8 bits.
std::vector<std::byte> result_of(std::int64_t item) {
  return std::vector<std::byte>(static_cast<std::size_t>(item % 100),
                                static_cast<std::byte>(item & 0xFF));
}

/// How often rank 0 is given each item's result, which must be the item's own.
std::map<std::int64_t, int> visited(const ResumableItems& items) {
  std::map<std::int64_t, int> times;
  items.visit([&](std::int64_t item, std::span<const std::byte> result) {
    ++times[item];
    EXPECT_THAT(result, testing::ElementsAreArray(result_of(item))) << "item " << item;
  });
  return times;
}

/// How many items all ranks did in complete().
std::uint64_t completed(ResumableItems& items, const std::vector<std::int64_t>& numbers) {
  std::array<std::uint64_t, 1> done{};
  items.complete(numbers, "", [&](std::int64_t item) {
    ++done[0];
    return result_of(item);
  });
  Communicator::world().sum(done);
  return done[0];
}

TEST(ProgressStore, EveryRankIsToldThatWorkOfOtherOptionsGaveWay) {
  const Communicator world = Communicator::world();
  const test::SharedFolder folder;
  UnfinishedWork work = {folder / "p", "rows", kDecides};
  work.gives_way = true;
  EXPECT_FALSE(ProgressStore(work, world).has_replaced());
  work.decides = {{"seed", "2"}};
  EXPECT_TRUE(ProgressStore(work, world).has_replaced());
}

TEST(ResumableItems, GivesEveryResultToRankZeroOnce) {
  const Communicator world = Communicator::world();
  for (const std::int64_t count : {0, 1, 3, 2000}) {
    const test::SharedFolder folder;
    ResumableItems items({folder / "p", "rows", kDecides}, world);
    EXPECT_EQ(completed(items, first_items(count)), static_cast<std::uint64_t>(count));
    if (!world.is_root()) continue;
    const std::map<std::int64_t, int> times = visited(items);
    EXPECT_EQ(times.size(), static_cast<std::size_t>(count));
    for (const auto& [item, number] : times) EXPECT_EQ(number, 1) << "item " << item;
  }
}

TEST(ResumableItems, DoesOnlyWhatNoEarlierRunFinished) {
  const Communicator world = Communicator::world();
  const test::SharedFolder folder;
  const UnfinishedWork work = {folder / "p", "rows", kDecides};
  const std::vector<std::int64_t> some = {3, 4, 17, 40};
  {
    ResumableItems items(work, world);
    EXPECT_EQ(completed(items, some), some.size());
  }
  ResumableItems items(work, world);
  EXPECT_EQ(completed(items, first_items(40)), 40U - 3U);
  // Item 40 was done earlier, but not asked for this time.
  if (world.is_root()) {
    EXPECT_EQ(visited(items).size(), 40U);
  }
}

TEST(ResumableItems, KeepsWhatWasFinishedBeforeAFailure) {
  const Communicator world = Communicator::world();
  const test::SharedFolder folder;
  const UnfinishedWork work = {folder / "p", "rows", kDecides};
  std::array<std::uint64_t, 1> finished{};
  {
    ResumableItems items(work, world);
    const auto fails_at_20 = [&](std::int64_t item) {
      if (item == 20) throw FileError("field.h5", "gone");
      ++finished[0];
      return result_of(item);
    };
    EXPECT_THROW(items.complete(first_items(50), "", fails_at_20), Error);
  }
  world.sum(finished);
  // Items are handed out in order, so those before the 20th were out, but for blocks that ranks had
  // not yet asked for.
  ASSERT_GT(finished[0], 0U);
  ResumableItems items(work, world);
  EXPECT_EQ(completed(items, first_items(50)), 50U - finished[0]);
}

TEST(ResumableItems, MissesWhatIsGone) {
  const Communicator world = Communicator::world();
  const test::SharedFolder folder;
  ResumableItems items({folder / "p", "rows", kDecides}, world);
  completed(items, first_items(10));
  if (!world.is_root()) return;
  for (const auto& entry : std::filesystem::directory_iterator(folder / "p"))
    if (entry.path().extension() == ".records") std::filesystem::resize_file(entry.path(), 0);
  EXPECT_THROW(visited(items), FileError);
}

TEST(ResumableItems, RefusesOtherOptionsOnEveryRank) {
  const Communicator world = Communicator::world();
  const test::SharedFolder folder;
  UnfinishedWork work = {folder / "p", "rows", kDecides};
  {
    ResumableItems items(work, world);
    completed(items, first_items(5));
  }
  work.decides = {{"seed", "2"}};
  try {
    const ResumableItems items(work, world);
    ADD_FAILURE() << "no error on rank " << world.rank();
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::Input);
    EXPECT_THAT(error.what(), testing::HasSubstr("seed = 2"));
  }
}

// Last: a stop request cannot be taken back.
TEST(ResumableItems, AStopOfOneRankSavesAndStopsAll) {
  const Communicator world = Communicator::world();
  const test::SharedFolder folder;
  ResumableItems items({folder / "p", "rows", kDecides}, world);
  listen_for_stop_requests();
  std::array<std::uint64_t, 1> done{};
  try {
    items.complete(first_items(5000), "rows of a test", [&](std::int64_t item) {
      if (++done[0] == 3) std::raise(SIGUSR1);
      return result_of(item);
    });
    ADD_FAILURE() << "not stopped on rank " << world.rank();
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::Stopped);
    world.sum(done);
    EXPECT_THAT(error.what(),
                testing::HasSubstr("rows of a test: " + std::to_string(done[0]) + " of 5000"));
  }
  // A rank passes over its items as soon as it has seen the request.
  EXPECT_LE(done[0], 3U * static_cast<std::uint64_t>(world.size()));
}

}  // namespace
}  // namespace af::cli
