// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace af::cli {

/// From now on SIGUSR1 asks for a stop with progress saved; so does SIGTERM without mpirun (with
/// it, mpirun itself passes SIGTERM on as a kill).
void listen_for_stop_requests();

/// Whether such a signal has come to this rank. May be called from any thread.
bool is_stop_requested();

}  // namespace af::cli
