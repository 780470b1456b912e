// SPDX-License-Identifier: Apache-2.0
#include "benchmark/watched_program.h"

#include <algorithm>
#include <chrono>
#include <fcntl.h>
#include <fstream>
#include <map>
#include <spawn.h>
#include <sys/wait.h>
#include <thread>
#include <unistd.h>

#include "base/error.h"

namespace af::benchmark {

namespace {

struct Process {
  pid_t parent = 0;
  std::string name;
};

/// Every process, but for those that end while this looks at them.
std::map<pid_t, Process> running_processes() {
  std::map<pid_t, Process> processes;
  for (const auto& entry : std::filesystem::directory_iterator("/proc")) {
    const std::string folder = entry.path().filename().string();
    if (!std::all_of(folder.begin(), folder.end(), [](char c) { return c >= '0' && c <= '9'; }))
      continue;
    std::ifstream file(entry.path() / "stat");
    std::string text;
    std::getline(file, text);
    // "pid (name) state parent ...": the name may hold anything.
    const std::size_t open = text.find('(');
    const std::size_t close = text.rfind(')');
    if (open == std::string::npos || close == std::string::npos || close + 4 > text.size())
      continue;
    processes[static_cast<pid_t>(std::stol(folder))] = {
        static_cast<pid_t>(std::strtol(text.c_str() + close + 4, nullptr, 10)),
        text.substr(open + 1, close - open - 1)};
  }
  return processes;
}

bool is_below(const std::map<pid_t, Process>& processes, pid_t pid, pid_t ancestor) {
  for (auto found = processes.find(pid); found != processes.end();
       found = processes.find(found->second.parent))
    if (found->first == ancestor) return true;
  return false;
}

std::uint64_t proportional_set_bytes(pid_t pid) {
  std::ifstream file("/proc/" + std::to_string(pid) + "/smaps_rollup");
  for (std::string line; std::getline(file, line);)
    if (line.starts_with("Pss:")) return std::strtoull(line.c_str() + 4, nullptr, 10) * 1024;
  return 0;
}

std::uint64_t memory_below(pid_t ancestor, const std::string& process_name) {
  const auto processes = running_processes();
  std::uint64_t bytes = 0;
  for (const auto& [pid, process] : processes)
    if (process.name == process_name && is_below(processes, pid, ancestor))
      bytes += proportional_set_bytes(pid);
  return bytes;
}

/// File actions that send standard output and error to a file.
class OutputToFile {
 public:
  explicit OutputToFile(const std::filesystem::path& path) {
    posix_spawn_file_actions_init(&actions_);
    posix_spawn_file_actions_addopen(
        &actions_, STDOUT_FILENO, path.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0644);
    posix_spawn_file_actions_adddup2(&actions_, STDOUT_FILENO, STDERR_FILENO);
  }
  ~OutputToFile() { posix_spawn_file_actions_destroy(&actions_); }
  OutputToFile(const OutputToFile&) = delete;
  OutputToFile& operator=(const OutputToFile&) = delete;
  [[nodiscard]] const posix_spawn_file_actions_t* get() const { return &actions_; }

 private:
  posix_spawn_file_actions_t actions_{};
};

/// The environment without MPI's settings for this process, because the child is none of its ranks.
std::vector<std::string> environment_of_child() {
  std::vector<std::string> variables;
  for (char** variable = environ; *variable != nullptr; ++variable) {
    const std::string text = *variable;
    const bool is_mpi = text.starts_with("OMPI_COMM_") || text.starts_with("PMIX_") ||
                        text.starts_with("OMPI_MCA_orte_") || text.starts_with("OMPI_MCA_ess");
    if (!is_mpi) variables.push_back(text);
  }
  return variables;
}

std::vector<char*> pointers_to(std::vector<std::string>& texts) {
  std::vector<char*> pointers;
  pointers.reserve(texts.size() + 1);
  for (std::string& text : texts) pointers.push_back(text.data());
  pointers.push_back(nullptr);
  return pointers;
}

}  // namespace

WatchedRun run_watched(const std::vector<std::string>& command,
                       const std::filesystem::path& log,
                       const std::string& process_name,
                       WatchMemory watch_memory) {
  std::vector<std::string> arguments = command;
  std::vector<std::string> variables = environment_of_child();
  const OutputToFile output(log);
  const auto start = std::chrono::steady_clock::now();
  pid_t child = 0;
  if (posix_spawnp(&child,
                   command.front().c_str(),
                   output.get(),
                   nullptr,
                   pointers_to(arguments).data(),
                   pointers_to(variables).data()) != 0)
    throw FileError(command.front(), "cannot be run");
  WatchedRun run;
  int status = 0;
  if (watch_memory == WatchMemory::Yes)
    while (waitpid(child, &status, WNOHANG) == 0) {
      run.peak_bytes = std::max(run.peak_bytes, memory_below(child, process_name));
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
    }
  else
    waitpid(child, &status, 0);
  run.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  if (WIFEXITED(status)) run.exit_code = WEXITSTATUS(status);
  return run;
}

void forget_cached_pages(const std::filesystem::path& path) {
  const int file = open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (file < 0) return;
  posix_fadvise(file, 0, 0, POSIX_FADV_DONTNEED);
  close(file);
}

}  // namespace af::benchmark
