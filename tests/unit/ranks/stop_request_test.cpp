// SPDX-License-Identifier: Apache-2.0
// Each test is a process of its own, because a request cannot be taken back.
#include "ranks/stop_request.h"

#include <chrono>
#include <csignal>
#include <thread>

#include <CLI/CLI.hpp>
#include <gtest/gtest.h>

#include "cli/run_limits.h"
#include "ranks/process_group.h"

namespace af {
namespace {

TEST(StopRequest, ComesWhenTheHoursAreOver) {
  CLI::App app{"test"};
  cli::bind_run_limits(app);
  EXPECT_FALSE(is_stop_requested());
  app.parse("--max-hours 1e-9", false);
  std::this_thread::sleep_for(std::chrono::milliseconds(1));  // 1e-9 h are 3.6 us
  EXPECT_TRUE(is_stop_requested());
  EXPECT_EQ(stop_reason(), "--max-hours 1e-09");
}

TEST(StopRequest, ComesBySignal) {
  listen_for_stop_requests();
  EXPECT_EQ(stop_reason(), "");
  std::raise(SIGUSR1);
  EXPECT_TRUE(is_stop_requested());
  EXPECT_EQ(stop_reason(), "SIGUSR1");
}

TEST(StopRequest, LimitsAreChecked) {
  CLI::App app{"test"};
  cli::bind_run_limits(app);
  for (const char* bad : {"--max-hours 0",
                          "--max-hours -1",
                          "--max-hours nan",
                          "--max-hours 2h",
                          "--stall-minutes -1",
                          "--processes 0",
                          "--processes 257"})
    EXPECT_THROW(app.parse(bad, false), CLI::ParseError) << bad;
  app.parse("--stall-minutes 0", false);
  EXPECT_EQ(run_limits().stall_minutes, 0.0);
  app.parse("--processes 256", false);
  EXPECT_EQ(local_processes().count, kMostProcesses);
  EXPECT_FALSE(is_stop_requested());
}

}  // namespace
}  // namespace af
