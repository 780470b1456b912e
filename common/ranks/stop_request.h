// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <limits>
#include <string>

#include "base/described_fields.h"
#include "ranks/communicator.h"

namespace af {

/// When a long run ends by itself. The command line sets them (cli/run_limits.h).
struct RunLimits {
  double max_hours = std::numeric_limits<double>::infinity();  ///< since the program started
  double stall_minutes = 0.0;  ///< time without progress after which a job is ended; 0: never

  void describe(Fields& field);
};
RunLimits& run_limits();

/// From now on SIGUSR1 asks for a stop with progress saved. So does SIGTERM without mpirun, which
/// itself passes SIGTERM on as a kill.
void listen_for_stop_requests();

/// Whether such a signal has come to this rank, or its --max-hours are over. Ranks may answer
/// differently for a moment, so they must agree before a collective call depends on it. May be
/// called from any thread. \test StopRequest.ComesWhenTheHoursAreOver
bool is_stop_requested();

/// Collective. Whether a stop was asked for on any rank.
bool is_stop_requested(const Communicator& communicator);

/// What asked for the stop: "SIGUSR1", "--max-hours 2"; empty when this rank does not know.
std::string stop_reason();

}  // namespace af
