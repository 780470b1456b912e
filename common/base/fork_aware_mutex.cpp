// SPDX-License-Identifier: Apache-2.0
#include "base/fork_aware_mutex.h"

#include <pthread.h>

#include "base/error.h"

namespace af {
namespace {

std::atomic<std::uint32_t> forks = 0;

/// Runs before main() or while the library is loaded, so before any fork of interest.
[[maybe_unused]] const int is_counting = pthread_atfork(nullptr, nullptr, [] { ++forks; });

constexpr int kThreadBits = 32;

/// Counts from 1. The thread that forks keeps its number in the copy.
std::uint32_t number_of_this_thread() {
  static std::atomic<std::uint32_t> latest = 0;
  thread_local const std::uint32_t mine = ++latest;
  return mine;
}

}  // namespace

std::uint32_t fork_generation() {
  return forks;
}

void ForkAwareMutex::lock() {
  const std::uint64_t generation = fork_generation();
  const std::uint32_t thread = number_of_this_thread();
  std::uint64_t holder = 0;
  while (!holder_.compare_exchange_strong(holder, generation << kThreadBits | thread)) {
    if (static_cast<std::uint32_t>(holder) == thread)
      throw InputError("this thread is in the middle of another call that uses the same thing");
    if (holder >> kThreadBits != generation)
      throw InputError(
          "this process is a copy (fork) of one in which another thread was at work: what that "
          "thread used cannot be used here; make it anew in the copy, or start processes that are "
          "no copies (multiprocessing: \"spawn\")");
    holder_.wait(holder);
    holder = 0;
  }
}

void ForkAwareMutex::unlock() {
  holder_ = 0;
  holder_.notify_one();
}

}  // namespace af
