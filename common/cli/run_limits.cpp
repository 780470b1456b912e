// SPDX-License-Identifier: Apache-2.0
#include "cli/run_limits.h"

#include <cstdlib>
#include <limits>
#include <string>

#include <CLI/CLI.hpp>

#include "run/stop_request.h"

namespace af::cli {
namespace {

constexpr double kStallMinutes = 30.0;

CLI::Validator at_least(double lowest, const std::string& words) {
  return {[=](const std::string& text) {
            char* end = nullptr;
            const double value = std::strtod(text.c_str(), &end);
            return *end == '\0' && value >= lowest ? std::string() : text + " is not " + words;
          },
          ""};
}

}  // namespace

void bind_run_limits(CLI::App& app) {
  RunLimits& limits = run_limits();
  limits.stall_minutes = kStallMinutes;
  app.add_option("--max-hours",
                 limits.max_hours,
                 "Stop by itself so many hours after the start, as on SIGUSR1: what is finished is "
                 "saved, exit code 75, and the same command goes on [no limit]")
      ->check(at_least(std::numeric_limits<double>::min(), "more than 0"));
  app.add_option("--stall-minutes",
                 limits.stall_minutes,
                 "End the job, with exit code 75, when a rank makes no progress for so many "
                 "minutes: longer than any unit of work takes; 0: never")
      ->check(at_least(0.0, "0 or more"))
      ->capture_default_str();
}

void bind_resume(CLI::App& app, bool& restarts) {
  app.add_flag("--restart",
               restarts,
               "Throw away what a stopped or killed run has finished (OUTPUT.progress)");
  bind_run_limits(app);
}

}  // namespace af::cli
