// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace af::test {

struct ProgramRun {
  int exit_code = -1;  ///< -1: ended by a signal
  std::string output;  ///< standard output and standard error
};

/// Runs a shell command and waits for its end.
ProgramRun run_command(const std::string& command);

/// An option that stops a program at its first unit of work.
constexpr const char* kStopAtOnce = " --max-hours 1e-9";

/// Runs a command that can continue after a stop: first for 0.1 s, then for twice as long each
/// time, until it ends by itself.
ProgramRun run_until_done(const std::string& command);

}  // namespace af::test
