// SPDX-License-Identifier: Apache-2.0
#include "base/thread_pool.h"

#include <chrono>
#include <functional>
#include <mutex>
#include <sched.h>
#include <stdexcept>
#include <string>
#include <sys/wait.h>
#include <unistd.h>

#include <gtest/gtest.h>

#include "base/error.h"
#include "base/fork_aware_mutex.h"
#include "base/stop_condition.h"

namespace af {
namespace {

class ThreadPoolOf : public testing::TestWithParam<int> {};

INSTANTIATE_TEST_SUITE_P(Threads, ThreadPoolOf, testing::Values(1, 2, 3, 8));

TEST_P(ThreadPoolOf, RunsEveryTaskOnce) {
  ThreadPool pool(GetParam());
  EXPECT_EQ(pool.threads(), GetParam());
  for (const int count : {0, 1, 2, 7, 1000}) {
    std::vector<std::atomic<int>> runs(static_cast<std::size_t>(count));
    pool.for_each(count, [&](int task, int /*slot*/) { ++runs[static_cast<std::size_t>(task)]; });
    for (const std::atomic<int>& times : runs) EXPECT_EQ(times, 1);
  }
}

TEST_P(ThreadPoolOf, ThreadsOfOneLoopHaveDifferentSlots) {
  ThreadPool pool(GetParam());
  std::vector<std::atomic<bool>> is_taken(static_cast<std::size_t>(GetParam()));
  std::atomic<int> clashes = 0;
  pool.for_each(2000, [&](int /*task*/, int slot) {
    std::atomic<bool>& mine = is_taken[static_cast<std::size_t>(slot)];
    if (mine.exchange(true)) ++clashes;
    mine = false;
  });
  EXPECT_EQ(clashes, 0);
}

TEST_P(ThreadPoolOf, BlocksCoverEveryNumberOnce) {
  ThreadPool pool(GetParam());
  for (const int count : {0, 1, 15, 16, 17, 100}) {
    std::vector<std::atomic<int>> runs(static_cast<std::size_t>(count));
    pool.for_each_block(count, 16, [&](int begin, int end) {
      EXPECT_LE(end - begin, 16);
      for (int i = begin; i < end; ++i) ++runs[static_cast<std::size_t>(i)];
    });
    for (const std::atomic<int>& times : runs) EXPECT_EQ(times, 1);
  }
}

TEST_P(ThreadPoolOf, NestedLoopsRunEveryTaskOnce) {
  ThreadPool pool(GetParam());
  std::atomic<int> sum = 0;
  for (int repeat = 0; repeat < 50; ++repeat)
    pool.for_each(5, [&](int outer, int /*slot*/) {
      pool.for_each(7, [&](int inner, int /*slot*/) { sum += 7 * outer + inner; });
    });
  EXPECT_EQ(sum, 50 * (34 * 35 / 2));
}

TEST_P(ThreadPoolOf, ThrowsTheExceptionOfTheLowestTaskThatFailed) {
  ThreadPool pool(GetParam());
  for (int repeat = 0; repeat < 50; ++repeat) {
    try {
      pool.for_each(100, [](int task, int /*slot*/) {
        if (task % 10 == 3) throw std::runtime_error("task " + std::to_string(task));
      });
      FAIL() << "nothing was thrown";
    } catch (const std::runtime_error& error) {
      EXPECT_STREQ(error.what(), "task 3");
    }
  }
}

TEST_P(ThreadPoolOf, WorksAgainAfterItsThreadsSlept) {
  ThreadPool pool(GetParam());
  for (int repeat = 0; repeat < 20; ++repeat) {
    // Far longer than the threads watch for work.
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
    std::atomic<int> done = 0;
    pool.for_each(10, [&](int /*task*/, int /*slot*/) { ++done; });
    EXPECT_EQ(done, 10);
  }
}

TEST(ThreadPool, SeveralThreadsTakePartInALoopOfWaitingTasks) {
  // Every task waits until all of them have begun: one thread alone would wait for ever.
  ThreadPool pool(4);
  std::atomic<int> begun = 0;
  pool.for_each(4, [&](int /*task*/, int /*slot*/) {
    ++begun;
    while (begun < 4) std::this_thread::yield();
  });
  EXPECT_EQ(begun, 4);
}

TEST(ThreadPool, ZeroThreadsMeansTheProcessorsThatTheProcessMayUse) {
  cpu_set_t before;
  CPU_ZERO(&before);
  ASSERT_EQ(sched_getaffinity(0, sizeof(before), &before), 0);
  EXPECT_EQ(thread_count(0), CPU_COUNT(&before));
  cpu_set_t one;
  CPU_ZERO(&one);
  for (std::size_t cpu = 0; CPU_COUNT(&one) == 0; ++cpu)
    if (CPU_ISSET(cpu, &before)) CPU_SET(cpu, &one);
  ASSERT_EQ(sched_setaffinity(0, sizeof(one), &one), 0);
  EXPECT_EQ(thread_count(0), 1);
  EXPECT_EQ(thread_count(3), 3);
  ASSERT_EQ(sched_setaffinity(0, sizeof(before), &before), 0);
}

TEST(ThreadPool, RefusesNegativeAndAbsurdNumbers) {
  EXPECT_TRUE(thread_problems(0).empty());
  EXPECT_TRUE(thread_problems(1024).empty());
  EXPECT_EQ(thread_problems(-1).size(), 1u);
  EXPECT_EQ(thread_problems(1025).size(), 1u);
}

/// Whether `works` returns true in a fork of this process. An alarm ends a fork that hangs.
bool in_copy(const std::function<bool()>& works) {
  const pid_t copy = ::fork();
  if (copy == 0) {
    ::alarm(20);
    ::_exit(works() ? 0 : 1);
  }
  int status = -1;
  ::waitpid(copy, &status, 0);
  return status == 0;
}

TEST_P(ThreadPoolOf, StartsItsThreadsAnewInACopyOfTheProcess) {
  ThreadPool pool(GetParam());
  const auto all_take_part = [&] {
    std::atomic<int> begun = 0;
    pool.for_each(GetParam(), [&](int /*task*/, int /*slot*/) {
      ++begun;
      while (begun < GetParam()) std::this_thread::yield();
    });
    return begun == GetParam();
  };
  EXPECT_TRUE(all_take_part());
  EXPECT_TRUE(in_copy([&] { return all_take_part() && in_copy(all_take_part); }));
  EXPECT_TRUE(in_copy([&] { return std::make_unique<ThreadPool>(GetParam()) != nullptr; }));
  EXPECT_TRUE(all_take_part());
}

TEST(ThreadPool, OfAnotherThreadMayBeForgottenInACopyOfTheProcess) {
  ThreadPool pool(3);
  std::atomic<bool> is_over = false;
  std::jthread other([&] {
    while (!is_over) pool.for_each(100, [](int /*task*/, int /*slot*/) {});
  });
  for (int i = 0; i < 50; ++i)
    EXPECT_TRUE(in_copy([&] {
      std::destroy_at(&pool);
      return true;
    }));
  is_over = true;
}

TEST(ForkAwareMutex, IsRefusedInACopyWhereAnotherThreadHeldIt) {
  ForkAwareMutex mutex;
  const auto is_refused = [&] {
    try {
      const std::lock_guard lock(mutex);
      return false;
    } catch (const InputError& error) {
      return std::string(error.what()).find("copy (fork)") != std::string::npos;
    }
  };
  EXPECT_TRUE(in_copy([&] { return !is_refused() && !is_refused(); }));
  std::atomic<bool> is_held = false;
  std::atomic<bool> is_over = false;
  std::jthread other([&] {
    const std::lock_guard lock(mutex);
    is_held = true;
    is_over.wait(false);
  });
  while (!is_held) std::this_thread::yield();
  EXPECT_TRUE(in_copy([&] { return is_refused() && is_refused(); }));
  is_over = true;
  is_over.notify_all();
  EXPECT_FALSE(is_refused());
}

TEST(ForkAwareMutex, ExcludesOtherThreadsAndRefusesItsHolder) {
  ForkAwareMutex mutex;
  int sum = 0;
  ThreadPool pool(4);
  pool.for_each(20000, [&](int /*task*/, int /*slot*/) {
    const std::lock_guard lock(mutex);
    ++sum;
  });
  EXPECT_EQ(sum, 20000);
  const std::lock_guard lock(mutex);
  EXPECT_THROW(mutex.lock(), InputError);
}

TEST(StopCondition, EndsALoopOnAllItsThreads) {
  for (const int threads : {1, 3}) {
    ThreadPool pool(threads);
    const std::thread::id caller = std::this_thread::get_id();
    int questions = 0;
    std::atomic<int> nested_ends = 0;
    const auto nested = [&](int /*task*/, int /*slot*/) {
      try {
        pool.for_each(1 << 30, [](int /*task*/, int /*slot*/) { std::this_thread::yield(); });
      } catch (const StoppedError&) {
        ++nested_ends;
        throw;
      }
    };
    {
      const StopCondition condition([&] {
        EXPECT_EQ(std::this_thread::get_id(), caller);
        return ++questions == 2;
      });
      EXPECT_THROW(pool.for_each(threads, nested), StoppedError);
      EXPECT_GT(nested_ends, 0);
      EXPECT_THROW(pool.for_each(1, [](int /*task*/, int /*slot*/) {}), StoppedError);
    }
    EXPECT_EQ(questions, 2);
    pool.for_each(1, [](int /*task*/, int /*slot*/) {});
  }
}

}  // namespace
}  // namespace af
