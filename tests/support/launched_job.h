// SPDX-License-Identifier: Apache-2.0
// A job under mpirun that a test watches and cuts short.
#pragma once

#include <chrono>
#include <filesystem>
#include <functional>
#include <string>
#include <sys/types.h>
#include <vector>

namespace af::test {

class LaunchedJob {
 public:
  /// Starts `command` (program and arguments) in the background; what it prints goes to `output`.
  LaunchedJob(const std::vector<std::string>& command, const std::filesystem::path& output);
  /// Kills all processes of the job that still run.
  ~LaunchedJob();
  LaunchedJob(const LaunchedJob&) = delete;
  LaunchedJob& operator=(const LaunchedJob&) = delete;

  [[nodiscard]] pid_t launcher() const { return launcher_; }
  /// The processes that the launcher is running.
  [[nodiscard]] std::vector<pid_t> ranks() const;
  [[nodiscard]] bool has_ended();

  /// Polls `condition` every millisecond; false when the job ended first, or after five minutes.
  bool wait_until(const std::function<bool()>& condition);

  /// Exit code of the launcher (128 + signal when it was killed), once it and all its ranks are
  /// gone. Throws when any is left after `limit`.
  int wait(std::chrono::seconds limit);

 private:
  void remember_ranks();

  pid_t launcher_ = -1;
  int status_ = 0;
  bool is_reaped_ = false;
  std::vector<pid_t> known_ranks_;
};

}  // namespace af::test
