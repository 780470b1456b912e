// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "cli/app_forward.h"

namespace af::cli {

/// Adds --max-hours and --stall-minutes to a program, or a sub-command, that can go on after a
/// stop.
void bind_run_limits(CLI::App& app);

/// Adds --restart, --max-hours and --stall-minutes to a program, or a sub-command, whose unfinished
/// work lies in progress_folder(OUTPUT).
void bind_resume(CLI::App& app, bool& restarts);

}  // namespace af::cli
