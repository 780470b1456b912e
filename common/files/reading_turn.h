// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "base/fork_aware_mutex.h"

namespace af {

/// A lock to hold while a thread reads files by HDF5, ITK or GDCM and other threads may do so too:
/// these libraries are single-threaded. Its holder must not wait for a thread that may want it.
class ReadingTurn {
 public:
  ReadingTurn() {
    if (depth() == 0) mutex().lock();
    ++depth();
  }
  ~ReadingTurn() {
    if (--depth() == 0) mutex().unlock();
  }
  ReadingTurn(const ReadingTurn&) = delete;
  ReadingTurn& operator=(const ReadingTurn&) = delete;

 private:
  static ForkAwareMutex& mutex() {
    static ForkAwareMutex one;
    return one;
  }
  /// Depth in this thread: a reader may use another one.
  static int& depth() {
    thread_local int turns = 0;
    return turns;
  }
};

}  // namespace af
