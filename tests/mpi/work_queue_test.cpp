// SPDX-License-Identifier: Apache-2.0
#include "ranks/work_queue.h"

#include <chrono>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "base/error.h"

namespace af {
namespace {

TEST(WorkQueue, DoesEveryItemExactlyOnce) {
  const Communicator world = Communicator::world();
  for (const std::int64_t count : {0, 1, 2, 7, 1000}) {
    std::vector<std::uint64_t> times(static_cast<std::size_t>(count), 0);
    std::int64_t reported = 0;
    for_each_item(
        world,
        count,
        [&](std::int64_t item) { ++times[static_cast<std::size_t>(item)]; },
        [&](std::int64_t done) { reported = done; });
    world.sum(times);
    EXPECT_EQ(times, std::vector<std::uint64_t>(times.size(), 1)) << count << " items";
    if (world.is_root()) {
      EXPECT_EQ(reported, count);
    }
  }
}

TEST(WorkQueue, LongItemsOnRankZeroDoNotStarveOthers) {
  const Communicator world = Communicator::world();
  if (world.size() < 2) GTEST_SKIP() << "needs two ranks";
  // Every item takes 250 times longer on rank 0, so the others must do most of them meanwhile.
  std::vector<std::uint64_t> items{0};
  for_each_item(world, 40, [&](std::int64_t) {
    std::this_thread::sleep_for(std::chrono::milliseconds(world.is_root() ? 500 : 2));
    ++items[0];
  });
  if (world.is_root()) {
    EXPECT_LT(items[0], 20u);
  }
  world.sum(items);
  EXPECT_EQ(items[0], 40u);
}

TEST(WorkQueue, FailureOfOneItemIsThrownOnEveryRank) {
  const Communicator world = Communicator::world();
  const auto fails_at_5 = [](std::int64_t item) {
    if (item == 5) throw FileError("field.h5", "gone");
  };
  try {
    for_each_item(world, 100, fails_at_5);
    ADD_FAILURE() << "no error on rank " << world.rank();
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::File);
  }
}

TEST(WorkQueue, FailureOfTheReportOfProgressIsThrownOnEveryRank) {
  const Communicator world = Communicator::world();
  const auto on_progress = [](std::int64_t) { throw FileError("progress.txt", "disk full"); };
  try {
    for_each_item(
        world,
        100,
        [](std::int64_t) { std::this_thread::sleep_for(std::chrono::milliseconds(1)); },
        on_progress);
    ADD_FAILURE() << "no error on rank " << world.rank();
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::File);
  }
}

TEST(BlockSize, ShrinksTowardsTheEndAndLastsTwoSecondsAtMost) {
  // Nothing is known yet.
  EXPECT_EQ(block_size(1000000, 0, 10, 0.0), 1);
  // 10 ranks did 5000 items of 2 ms in one second. One rank takes two seconds for 1000 of them.
  EXPECT_EQ(block_size(1000000, 5000, 10, 1.0), 1000);
  // A quarter of a rank's share of 4000 items is 100.
  EXPECT_EQ(block_size(4000, 5000, 10, 1.0), 100);
  EXPECT_EQ(block_size(39, 5000, 10, 1.0), 1);
  EXPECT_EQ(block_size(0, 5000, 10, 1.0), 1);
  // Items of a minute go one by one.
  EXPECT_EQ(block_size(1000000, 10, 10, 60.0), 1);
}

}  // namespace
}  // namespace af
