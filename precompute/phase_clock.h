// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <string>
#include <utility>
#include <vector>

#include "base/joined.h"
#include "precompute/formatted_text.h"

namespace af {

/// Phases of a run, in order, with the seconds that each took.
using PhaseSeconds = std::vector<std::pair<std::string, double>>;

/// "read 1.2, cast 3.4".
inline std::string seconds_text(const PhaseSeconds& seconds) {
  return joined(seconds, ", ", [](const auto& phase) {
    return phase.first + formatted(phase.second < 9.95 ? " %.1f" : " %.0f", phase.second);
  });
}

/// Measures phases.
class PhaseClock {
 public:
  void end(const std::string& phase) {
    const auto now = std::chrono::steady_clock::now();
    seconds_.emplace_back(phase, std::chrono::duration<double>(now - start_).count());
    start_ = now;
  }
  /// Records part of the time since the last end() as a separate phase.
  void split(const std::string& phase, double seconds) {
    seconds_.emplace_back(phase, seconds);
    start_ += std::chrono::duration_cast<std::chrono::steady_clock::duration>(
        std::chrono::duration<double>(seconds));
  }
  [[nodiscard]] const PhaseSeconds& phases() const { return seconds_; }
  [[nodiscard]] double seconds_of(const std::string& phase) const {
    for (const auto& [name, seconds] : seconds_)
      if (name == phase) return seconds;
    return 0.0;
  }

 private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
  PhaseSeconds seconds_;
};

}  // namespace af
