// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstdint>
#include <exception>
#include <mutex>
#include <string>
#include <thread>
#include <type_traits>
#include <vector>

namespace af {

/// Processors that this process may run on, at least 1.
int usable_processors();

/// What an option --threads asks for: 0 means usable_processors().
int thread_count(int requested);

/// "threads = -1: must be 0 (all processors) or more", up to 1024.
std::vector<std::string> thread_problems(int requested);

/// Threads that share the tasks of loops. The calling thread is one of them. The others watch for
/// work for a short while after their last task, and then sleep. Loops may be nested: a task may
/// call for_each(), and threads without work help with it. Loops do not allocate. Only one thread
/// from outside may call at a time. A StopCondition ends loops early. In a copy of the process
/// (fork), the first loop starts the threads again. \test ThreadPoolOf.RunsEveryTaskOnce
class ThreadPool {
 public:
  /// `threads` includes the caller's.
  explicit ThreadPool(int threads = 1);
  ~ThreadPool();
  ThreadPool(const ThreadPool&) = delete;
  ThreadPool& operator=(const ThreadPool&) = delete;

  [[nodiscard]] int threads() const { return static_cast<int>(helpers_.size()) + 1; }

  /// Calls work(task, slot) once for every task in [0, count), in any order and concurrently.
  /// `slot`, below threads(), differs between threads: it is a key to scratch memory. Throws the
  /// exception of the lowest task that failed; tasks after it may not have run.
  template <typename Work>
  void for_each(int count, Work&& work) {
    const auto call = [](void* context, int task, int slot) {
      (*static_cast<std::remove_reference_t<Work>*>(context))(task, slot);
    };
    Loop loop{call, const_cast<void*>(static_cast<const void*>(&work)), count};
    run(loop);
  }

  /// Calls work(begin, end) for [0, count) in blocks of `block`, the last one perhaps smaller.
  template <typename Work>
  void for_each_block(int count, int block, Work&& work) {
    for_each((count + block - 1) / block, [&](int task, int /*slot*/) {
      work(task * block, task * block + block < count ? task * block + block : count);
    });
  }

 private:
  /// One call of for_each().
  struct Loop {
    void (*call)(void* work, int task, int slot);
    void* work;
    int count;
    std::atomic<int> next_task = 0;
    std::atomic<int> helpers = 0;  ///< how many are inside; changes under mutex_
    int failed_task = 0;           ///< with `failure`, under mutex_
    std::exception_ptr failure = nullptr;
  };

  void run(Loop& loop);
  void share(Loop& loop);
  void start_helpers(int count);
  void forget_helpers();
  void run_tasks(Loop& loop, int slot);
  void publish(Loop& loop);
  void withdraw(Loop& loop);
  Loop* join_oldest();
  void leave(Loop& loop);
  void wait_for_news(int seen);
  void help(int slot);
  [[nodiscard]] int my_slot() const;

  std::mutex mutex_;
  std::vector<Loop*> open_;          ///< under mutex_, oldest first
  std::atomic<int> news_ = 0;        ///< loops opened so far; idle helpers watch it
  std::atomic<int> departures_ = 0;  ///< loops whose last helper has left; their callers watch it
  std::atomic<bool> is_ending_ = false;
  std::uint32_t generation_;  ///< fork_generation() of the helpers
  std::vector<std::jthread> helpers_;
};

}  // namespace af
