// SPDX-License-Identifier: Apache-2.0
#include "support/launched_job.h"

#include <algorithm>
#include <csignal>
#include <fcntl.h>
#include <fstream>
#include <stdexcept>
#include <sys/wait.h>
#include <thread>
#include <unistd.h>

namespace af::test {

namespace {

using Clock = std::chrono::steady_clock;
constexpr std::chrono::milliseconds kPoll{1};

/// A process that has ended, or a zombie for which nobody has waited.
bool is_gone(pid_t process) {
  std::ifstream file("/proc/" + std::to_string(process) + "/stat");
  std::string stat;
  if (!std::getline(file, stat)) return true;
  const std::size_t state = stat.rfind(')') + 2;  // after the name, which may hold anything
  return state >= stat.size() || stat[state] == 'Z';
}

}  // namespace

LaunchedJob::LaunchedJob(const std::vector<std::string>& command,
                         const std::filesystem::path& output) {
  std::vector<char*> arguments;
  for (const std::string& word : command) arguments.push_back(const_cast<char*>(word.c_str()));
  arguments.push_back(nullptr);
  constexpr mode_t kMode = 0600;
  const int file = ::open(output.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, kMode);
  if (file < 0) throw std::runtime_error("cannot write " + output.string());
  launcher_ = fork();
  if (launcher_ == 0) {
    dup2(file, STDOUT_FILENO);
    dup2(file, STDERR_FILENO);
    execvp(arguments[0], arguments.data());
    _exit(127);
  }
  ::close(file);
  if (launcher_ < 0) throw std::runtime_error("cannot start " + command.front());
}

LaunchedJob::~LaunchedJob() {
  remember_ranks();
  for (const pid_t rank : known_ranks_)
    if (!is_gone(rank)) kill(rank, SIGKILL);
  if (has_ended()) return;
  kill(launcher_, SIGKILL);
  waitpid(launcher_, &status_, 0);
}

std::vector<pid_t> LaunchedJob::ranks() const {
  std::vector<pid_t> children;
  const std::filesystem::path tasks = "/proc/" + std::to_string(launcher_) + "/task";
  std::error_code gone;
  for (const auto& task : std::filesystem::directory_iterator(tasks, gone)) {
    std::ifstream file(task.path() / "children");
    for (pid_t child = 0; file >> child;) children.push_back(child);
  }
  return children;
}

void LaunchedJob::remember_ranks() {
  for (const pid_t rank : ranks())
    if (std::find(known_ranks_.begin(), known_ranks_.end(), rank) == known_ranks_.end())
      known_ranks_.push_back(rank);
}

bool LaunchedJob::has_ended() {
  if (!is_reaped_) is_reaped_ = waitpid(launcher_, &status_, WNOHANG) == launcher_;
  return is_reaped_;
}

bool LaunchedJob::wait_until(const std::function<bool()>& condition) {
  const auto deadline = Clock::now() + std::chrono::minutes(5);
  while (!condition()) {
    if (has_ended() || Clock::now() > deadline) return false;
    std::this_thread::sleep_for(kPoll);
  }
  remember_ranks();
  return true;
}

int LaunchedJob::wait(std::chrono::seconds limit) {
  const auto deadline = Clock::now() + limit;
  const auto is_over = [&] {
    return has_ended() && std::all_of(known_ranks_.begin(), known_ranks_.end(), is_gone);
  };
  while (!is_over()) {
    if (Clock::now() > deadline) throw std::runtime_error("the job, or a rank of it, goes on");
    if (!is_reaped_) remember_ranks();
    std::this_thread::sleep_for(kPoll);
  }
  return WIFEXITED(status_) ? WEXITSTATUS(status_) : 128 + WTERMSIG(status_);
}

}  // namespace af::test
