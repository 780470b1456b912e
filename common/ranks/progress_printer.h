// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstdint>
#include <string>

#include "base/progress.h"

namespace af {

/// Prints progress with elapsed time and ETA on standard error. On a terminal it rewrites one line
/// in place; otherwise it prints plain lines at most every ten seconds. Silent when `enabled` is
/// false (ranks other than 0).
class ProgressPrinter {
 public:
  ProgressPrinter(std::string label, bool enabled);
  ~ProgressPrinter();
  ProgressPrinter(const ProgressPrinter&) = delete;
  ProgressPrinter& operator=(const ProgressPrinter&) = delete;

  void update(double done, double total);
  /// A callback bound to this printer, which must outlive it.
  [[nodiscard]] ProgressCallback callback();

 private:
  std::string label_;
  bool enabled_;
  bool on_terminal_;
  bool printed_ = false;
  std::chrono::steady_clock::time_point start_;
  std::chrono::steady_clock::time_point last_print_;
};

/// "poses compared: 98, about 1 min 20 s on 2 ranks (1.6 s each)".
std::string expected_time_text(const std::string& what,
                               std::int64_t count,
                               double seconds_each,
                               int ranks);

/// "1 h 05 min", "3 min 20 s", "12.4 s".
std::string duration_text(double seconds);

}  // namespace af
