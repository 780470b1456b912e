// SPDX-License-Identifier: Apache-2.0
#include "run/process_state.h"

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <optional>
#include <sstream>
#include <system_error>

namespace af {

namespace {

/// Of /proc/PROCESS/stat.
struct ProcessStat {
  char state = '?';
  std::uint64_t threads = 0;
  std::uint64_t start = 0;
};

std::optional<ProcessStat> stat_of(int process) {
  std::ifstream file("/proc/" + std::to_string(process) + "/stat");
  std::string line;
  if (!std::getline(file, line)) return std::nullopt;
  // Field 2 is the name, which may hold anything; 3 is the state, 20 the threads, 22 the start.
  std::istringstream fields(line.substr(std::min(line.size(), line.rfind(')') + 1)));
  const auto skip = [&fields](int count) {
    for (std::string skipped; count > 0; --count) fields >> skipped;
  };
  ProcessStat stat;
  fields >> stat.state;
  skip(16);
  fields >> stat.threads;
  skip(1);
  fields >> stat.start;
  if (!fields) return std::nullopt;
  return stat;
}

}  // namespace

std::string process_space() {
  std::ifstream file("/proc/sys/kernel/random/boot_id");
  std::string space;
  if (!std::getline(file, space)) return {};
  for (const char* name : {"pid", "time"}) {
    std::error_code error;
    const auto link = std::filesystem::read_symlink(std::string("/proc/self/ns/") + name, error);
    if (!error) space += " " + link.string();
  }
  return space.find("pid:") == std::string::npos ? "" : space;
}

std::uint64_t process_start(int process) {
  const std::optional<ProcessStat> stat = stat_of(process);
  return stat ? stat->start : 0;
}

ProcessState process_state(int process, std::uint64_t start) {
  if (process <= 0 || start == 0) return ProcessState::NotTold;
  if (kill(process, 0) != 0 && errno == ESRCH) return ProcessState::HasEnded;
  const std::optional<ProcessStat> stat = stat_of(process);
  if (!stat) return ProcessState::NotTold;
  const bool is_dead = stat->state == 'Z' || stat->state == 'X' || stat->state == 'x';
  const bool has_ended = stat->start != start || (is_dead && stat->threads <= 1);
  return has_ended ? ProcessState::HasEnded : ProcessState::Runs;
}

}  // namespace af
