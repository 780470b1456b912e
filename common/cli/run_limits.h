// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "base/described_fields.h"
#include "cli/app_forward.h"

namespace af::cli {

/// Adds --max-hours, --stall-minutes and --processes to a program, or a sub-command, whose ranks
/// share the work and which can continue after a stop.
void bind_run_limits(CLI::App& app);

/// Options of a program, or a sub-command, that keeps unfinished work in OUTPUT.progress.
struct ResumeOptions {
  bool restarts = false;  ///< discards unfinished work

  void describe(Fields& field);
};

}  // namespace af::cli
