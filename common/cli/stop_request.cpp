// SPDX-License-Identifier: Apache-2.0
#include "cli/stop_request.h"

#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <limits>
#include <sstream>

#include <CLI/CLI.hpp>

namespace af::cli {
namespace {

using Clock = std::chrono::steady_clock;

std::atomic<int> stop_signal = 0;
static_assert(std::atomic<int>::is_always_lock_free, "what a signal handler may write");

constexpr double kStallMinutes = 30.0;

/// Set while the command line is parsed, before there are other threads.
struct RunLimits {
  Clock::time_point program_start = Clock::now();
  double max_hours = std::numeric_limits<double>::infinity();
  double stall_minutes = 0.0;
};
RunLimits limits;

extern "C" void remember_signal(int signal) {
  stop_signal = signal;
}

double hours_since_start() {
  return std::chrono::duration<double, std::ratio<3600>>(Clock::now() - limits.program_start)
      .count();
}

bool is_time_over() {
  return hours_since_start() > limits.max_hours;
}

CLI::Validator at_least(double lowest, const std::string& words) {
  return {[=](const std::string& text) {
            char* end = nullptr;
            const double value = std::strtod(text.c_str(), &end);
            return *end == '\0' && value >= lowest ? std::string() : text + " is not " + words;
          },
          ""};
}

}  // namespace

void listen_for_stop_requests() {
  std::signal(SIGUSR1, remember_signal);
  if (std::getenv("OMPI_COMM_WORLD_SIZE") == nullptr) std::signal(SIGTERM, remember_signal);
}

void bind_run_limits(CLI::App& app) {
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

bool is_stop_requested() {
  return stop_signal != 0 || is_time_over();
}

std::string stop_reason() {
  if (stop_signal == SIGTERM) return "SIGTERM";
  if (stop_signal != 0) return "SIGUSR1";
  // Another rank, which began a little earlier, may have asked.
  constexpr double kStartsWithinHours = 1.0 / 60.0;
  if (hours_since_start() + kStartsWithinHours < limits.max_hours) return {};
  std::ostringstream text;
  text << "--max-hours " << limits.max_hours;
  return text.str();
}

double stall_minutes() {
  return limits.stall_minutes;
}

}  // namespace af::cli
