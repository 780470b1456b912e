// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <string>

#include "precompute/phase_clock.h"
#include "ranks/communicator.h"
#include "ranks/run_folder.h"

namespace af {

/// What surrounds the work of a run: who does it, where it can stop, how long it takes.
struct PrecomputeRun {
  const Communicator& world;
  const std::string& command_line;
  RunFolder folder;
  int ranks_on_node = 1;
  PhaseClock clock;

  [[nodiscard]] std::function<bool()> stop_requested() const {
    return [this] { return folder.is_stop_requested(); };
  }
};

}  // namespace af
