// SPDX-License-Identifier: Apache-2.0
#include "cli/stop_request.h"

#include <atomic>
#include <csignal>
#include <cstdlib>

namespace af::cli {
namespace {

std::atomic<int> stop_signal = 0;
static_assert(std::atomic<int>::is_always_lock_free, "what a signal handler may write");

extern "C" void remember_signal(int signal) {
  stop_signal = signal;
}

}  // namespace

void listen_for_stop_requests() {
  std::signal(SIGUSR1, remember_signal);
  if (std::getenv("OMPI_COMM_WORLD_SIZE") == nullptr) std::signal(SIGTERM, remember_signal);
}

bool is_stop_requested() {
  return stop_signal != 0;
}

}  // namespace af::cli
