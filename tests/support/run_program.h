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

}  // namespace af::test
