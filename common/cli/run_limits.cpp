// SPDX-License-Identifier: Apache-2.0
#include "cli/run_limits.h"

#include "cli/bind_options.h"
#include "ranks/process_group.h"
#include "ranks/stop_request.h"

namespace af::cli {

void bind_run_limits(CLI::App& app) {
  constexpr double kStallMinutes = 30.0;
  run_limits().stall_minutes = kStallMinutes;
  bind_options(app, run_limits());
  bind_options(app, local_processes());
}

void ResumeOptions::describe(Fields& field) {
  field(
      "restart", restarts, "Discard the progress of a stopped run (OUTPUT.progress) and start over")
      .not_recorded("results are the same");
}

}  // namespace af::cli
