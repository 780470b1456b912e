// SPDX-License-Identifier: Apache-2.0
#include "ranks/stop_request.h"

#include <array>
#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <sstream>

#include "ranks/process_group.h"

namespace af {
namespace {

using Clock = std::chrono::steady_clock;

std::atomic<int> stop_signal = 0;
static_assert(std::atomic<int>::is_always_lock_free, "what a signal handler may write");

const Clock::time_point program_start = Clock::now();

/// Set while the command line is parsed, before there are other threads.
RunLimits limits;

extern "C" void remember_signal(int signal) {
  if (stop_signal.exchange(signal) == 0) pass_on_signal(signal);
}

double hours_since_start() {
  return std::chrono::duration<double, std::ratio<3600>>(Clock::now() - program_start).count();
}

bool is_time_over() {
  return hours_since_start() > limits.max_hours;
}

}  // namespace

void listen_for_stop_requests() {
  std::signal(SIGUSR1, remember_signal);
  if (std::getenv("OMPI_COMM_WORLD_SIZE") == nullptr) std::signal(SIGTERM, remember_signal);
}

void RunLimits::describe(Fields& field) {
  const char* const why = "results are the same";
  field("max_hours",
        max_hours,
        "Stop after this many hours with exit code 75; the same command then continues [no limit]")
      .above(0.0)
      .checked_when_typed()
      .default_in_help()
      .not_recorded(why);
  field("stall_minutes",
        stall_minutes,
        "End the job, with exit code 75, when a rank makes no progress for this many minutes; 0: "
        "never")
      .at_least(0.0)
      .checked_when_typed()
      .not_recorded(why);
}

RunLimits& run_limits() {
  return limits;
}

bool is_stop_requested() {
  return stop_signal != 0 || is_time_over();
}

bool is_stop_requested(const Communicator& communicator) {
  std::array<std::uint64_t, 1> stops{is_stop_requested() ? 1U : 0U};
  communicator.maximum(stops);
  return stops[0] != 0;
}

std::string stop_reason() {
  if (stop_signal == SIGTERM) return "SIGTERM";
  if (stop_signal != 0) return "SIGUSR1";
  // Another rank, which started a little earlier, may have asked.
  constexpr double kStartsWithinHours = 1.0 / 60.0;
  if (hours_since_start() + kStartsWithinHours < limits.max_hours) return {};
  std::ostringstream text;
  text << "--max-hours " << limits.max_hours;
  return text.str();
}

}  // namespace af
