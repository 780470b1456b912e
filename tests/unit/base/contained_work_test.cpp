// SPDX-License-Identifier: Apache-2.0
#include "base/contained_work.h"

#include <algorithm>
#include <csignal>
#include <cstdlib>
#include <latch>
#include <mutex>
#include <new>
#include <stdexcept>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace af {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

TEST(ContainedWork, GivesTheBytesThatWereMade) {
  const ContainedWork work = contained_work(3, [](std::span<char> bytes) {
    std::ranges::copy(std::string("abc"), bytes.begin());
    return true;
  });
  EXPECT_TRUE(work.is_done);
  EXPECT_THAT(work.bytes, ElementsAre('a', 'b', 'c'));
  EXPECT_EQ(work.trouble, "");
}

TEST(ContainedWork, ChangesNothingElse) {
  int mine = 1;
  EXPECT_TRUE(contained_work(1, [&](std::span<char>) {
                mine = 2;
                return true;
              }).is_done);
  EXPECT_EQ(mine, 1);
}

TEST(ContainedWork, SurvivesWhatEndsAProcess) {
  const ContainedWork aborted = contained_work(1, [](std::span<char>) -> bool { std::abort(); });
  EXPECT_FALSE(aborted.is_done);
  EXPECT_THAT(aborted.trouble, HasSubstr("signal " + std::to_string(SIGABRT)));
  const ContainedWork killed = contained_work(1, [](std::span<char>) {
    std::raise(SIGSEGV);
    return true;
  });
  EXPECT_FALSE(killed.is_done);
  EXPECT_THAT(killed.trouble, HasSubstr("signal " + std::to_string(SIGSEGV)));
  const ContainedWork left =
      contained_work(1, [](std::span<char>) -> bool { std::_Exit(EXIT_SUCCESS); });
  EXPECT_FALSE(left.is_done);
  EXPECT_THAT(left.trouble, HasSubstr("without a result"));
}

TEST(ContainedWork, WhatIsThrownOrRefusedIsNotDone) {
  EXPECT_EQ(contained_work(1, [](std::span<char>) { return false; }).trouble, "refused it");
  EXPECT_EQ(
      contained_work(1, [](std::span<char>) -> bool { throw std::runtime_error("x"); }).trouble,
      "refused it");
}

// 4 GiB for one byte exceed the limit, but the allocator alone would still grant them.
TEST(ContainedWork, IsEndedWhenItAsksForFarMoreMemoryThanItsBytesAreWorth) {
  EXPECT_FALSE(contained_work(1, [](std::span<char> bytes) {
                 std::vector<char> much(std::size_t{1} << 32, 'a');
                 bytes[0] = much[much.size() / 2];
                 return true;
               }).is_done);
}

// The watchdog's thread, or another reader, may hold such a lock.
TEST(ContainedWork, IsEndedWhenItWaitsForWhatAnotherThreadHasLocked) {
  std::mutex mutex;
  std::latch is_locked(1), is_over(1);
  std::jthread other([&] {
    const std::scoped_lock lock(mutex);
    is_locked.count_down();
    is_over.wait();
  });
  is_locked.wait();
  sigset_t alarm;
  sigemptyset(&alarm);
  sigaddset(&alarm, SIGALRM);
  pthread_sigmask(SIG_BLOCK, &alarm, nullptr);
  const ContainedWork work = contained_work(
      1,
      [&](std::span<char>) {
        const std::scoped_lock lock(mutex);
        return true;
      },
      1);
  pthread_sigmask(SIG_UNBLOCK, &alarm, nullptr);
  is_over.count_down();
  EXPECT_FALSE(work.is_done);
  EXPECT_EQ(work.trouble, "did not end in time");
}

TEST(ContainedWork, HandlersOfTheProgramAreNotCalledInTheCopy) {
  static volatile std::sig_atomic_t calls = 0;
  const auto before = std::signal(SIGABRT, [](int) { calls = calls + 1; });
  const ContainedWork work = contained_work(1, [](std::span<char>) -> bool { std::abort(); });
  std::signal(SIGABRT, before);
  EXPECT_EQ(calls, 0);
  EXPECT_THAT(work.trouble, HasSubstr("signal"));
}

}  // namespace
}  // namespace af
