// SPDX-License-Identifier: Apache-2.0
// fork() copies the memory of a process, but only the thread that calls it.
#pragma once

#include <atomic>
#include <cstdint>

namespace af {

/// Grows with every fork() between this process and the one that loaded this code.
std::uint32_t fork_generation();

/// A mutex that nobody waits for in vain. If another thread held it at the fork(), what it guards
/// may be half changed, so in the copy of the process lock() throws InputError, every time. It also
/// throws for the thread that already holds it. \test
/// ForkAwareMutex.IsRefusedInACopyWhereAnotherThreadHeldIt
class ForkAwareMutex {
 public:
  void lock();
  void unlock();

 private:
  std::atomic<std::uint64_t> holder_ =
      0;  ///< generation and number of the thread that holds it; 0: nobody
};

}  // namespace af
