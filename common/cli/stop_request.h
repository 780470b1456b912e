// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "cli/app_forward.h"

namespace af::cli {

/// From now on SIGUSR1 asks for a stop with progress saved; so does SIGTERM without mpirun (with
/// it, mpirun itself passes SIGTERM on as a kill).
void listen_for_stop_requests();

/// Adds --max-hours and --stall-minutes to a program, or a subcommand, that can go on after a stop.
/// \test StopRequest.ComesWhenTheHoursAreOver
void bind_run_limits(CLI::App& app);

/// Adds --restart, --max-hours and --stall-minutes to a program, or a subcommand, whose unfinished
/// work lies in progress_folder(OUTPUT).
void bind_resume(CLI::App& app, bool& restarts);

/// Whether such a signal has come to this rank, or its --max-hours are over. Ranks may answer
/// differently for a moment: they must agree before a collective call depends on it. May be called
/// from any thread.
bool is_stop_requested();

/// What asked for the stop that has come: "SIGUSR1", "--max-hours 2"; empty when this rank does not
/// know.
std::string stop_reason();

/// Minutes without progress after which a job is ended; 0: never.
double stall_minutes();

}  // namespace af::cli
