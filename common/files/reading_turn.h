// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <mutex>

namespace af {

/// A lock to hold while a thread reads files by HDF5, ITK or GDCM and other threads may do so, too:
/// these libraries are single-threaded. Its holder must not wait for a thread that may want it.
class ReadingTurn {
 public:
  ReadingTurn() : guard_(mutex()) {}

 private:
  /// A reader may use another one.
  static std::recursive_mutex& mutex() {
    static std::recursive_mutex one;
    return one;
  }

  std::lock_guard<std::recursive_mutex> guard_;
};

}  // namespace af
