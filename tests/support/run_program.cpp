// SPDX-License-Identifier: Apache-2.0
#include "support/run_program.h"

#include <array>
#include <cstdio>
#include <stdexcept>
#include <sys/wait.h>

namespace af::test {

ProgramRun run_command(const std::string& command) {
  FILE* const pipe = popen((command + " 2>&1").c_str(), "r");
  if (pipe == nullptr) throw std::runtime_error("cannot run " + command);
  ProgramRun run;
  std::array<char, 4096> buffer{};
  for (;;) {
    const std::size_t count = std::fread(buffer.data(), 1, buffer.size(), pipe);
    if (count == 0) break;
    run.output.append(buffer.data(), count);
  }
  const int status = pclose(pipe);
  if (WIFEXITED(status)) run.exit_code = WEXITSTATUS(status);
  return run;
}

ProgramRun run_until_done(const std::string& command) {
  constexpr int kStopped = 75;
  ProgramRun run;
  run.exit_code = kStopped;
  for (double hours = 0.1 / 3600.0; run.exit_code == kStopped; hours *= 2.0)
    run = run_command(command + " --max-hours " + std::to_string(hours));
  return run;
}

}  // namespace af::test
