// SPDX-License-Identifier: Apache-2.0
#include "base/contained_work.h"

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <fcntl.h>
#include <fstream>
#include <new>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

namespace af {

namespace {

/// Memory that a copy of this process shares with it.
class SharedBytes {
 public:
  explicit SharedBytes(std::size_t count)
      : count_(count),
        start_(::mmap(nullptr, count, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0)) {
    if (start_ == MAP_FAILED) throw std::bad_alloc();
  }
  ~SharedBytes() { ::munmap(start_, count_); }
  SharedBytes(const SharedBytes&) = delete;
  SharedBytes& operator=(const SharedBytes&) = delete;

  [[nodiscard]] std::span<char> bytes() const { return {static_cast<char*>(start_), count_}; }

 private:
  std::size_t count_;
  void* start_;
};

/// How the work ended, as the copy records it. The exit status is not enough: other code of a
/// program that uses us as a library may take it first.
enum class Verdict : char { None = 0, Done, Refused };

void set_limit(decltype(RLIMIT_CPU) resource, rlim_t most) {
  rlimit limit{};
  if (::getrlimit(resource, &limit) != 0) return;
  limit.rlim_cur = std::min(limit.rlim_max, most);
  ::setrlimit(resource, &limit);
}

/// Seconds of processor time within which the work must be done.
std::size_t most_seconds(std::size_t bytes) {
  constexpr std::size_t kFewSeconds = 60;
  constexpr std::size_t kBytesPerSecond = 1u << 20;
  return kFewSeconds + bytes / kBytesPerSecond;
}

void limit_resources(std::size_t bytes) {
  constexpr std::size_t kBytesPerByte = 64;
  constexpr std::size_t kFewBytes = std::size_t{1} << 30;
  set_limit(RLIMIT_CORE, 0);
  set_limit(RLIMIT_CPU, most_seconds(bytes));
  std::size_t pages = 0;  // pages that the process has already
  if (std::ifstream("/proc/self/statm") >> pages)
    set_limit(RLIMIT_AS,
              pages * static_cast<std::size_t>(::sysconf(_SC_PAGESIZE)) + kFewBytes +
                  kBytesPerByte * bytes);
}

void be_quiet() {
  const int nothing = ::open("/dev/null", O_WRONLY | O_CLOEXEC);
  if (nothing < 0) return;
  ::dup2(nothing, STDOUT_FILENO);
  ::dup2(nothing, STDERR_FILENO);
}

/// Makes signals end the copy as they would end a plain program, whatever handlers this process has
/// and whatever this thread blocks.
void reset_signals() {
  sigset_t all;
  ::sigemptyset(&all);
  for (const int signal :
       {SIGABRT, SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGXCPU, SIGTERM, SIGINT, SIGALRM}) {
    ::signal(signal, SIG_DFL);
    ::sigaddset(&all, signal);
  }
  ::pthread_sigmask(SIG_UNBLOCK, &all, nullptr);
}

[[noreturn]] void run_copy(std::span<char> bytes,
                           char& verdict,
                           const std::function<bool(std::span<char>)>& work,
                           unsigned deadline_seconds) {
  reset_signals();
  ::alarm(deadline_seconds);  // the kernel ends the copy even when it waits for ever
  be_quiet();
  limit_resources(bytes.size());
  Verdict found = Verdict::Refused;
  try {
    if (work(bytes)) found = Verdict::Done;
  } catch (...) {
    found = Verdict::Refused;
  }
  verdict = static_cast<char>(found);
  ::_exit(0);  // nothing of this process may be tidied up or written twice
}

std::string end_of(int status, Verdict verdict) {
  if (verdict == Verdict::Refused) return "refused it";
  if (!WIFSIGNALED(status)) return "ended without a result";
  const int signal = WTERMSIG(status);
  if (signal == SIGALRM) return "did not end in time";
  return "ended by signal " + std::to_string(signal) + " (" + ::strsignal(signal) + ")";
}

}  // namespace

ContainedWork contained_work(std::size_t bytes,
                             const std::function<bool(std::span<char>)>& work,
                             std::optional<unsigned> deadline_seconds) {
  // On a busy machine, work gets only part of a processor.
  constexpr std::size_t kSecondsPerSecond = 5;
  const unsigned deadline =
      deadline_seconds.value_or(static_cast<unsigned>(kSecondsPerSecond * most_seconds(bytes)));
  const SharedBytes shared(bytes + 1);
  const std::span<char> made = shared.bytes().first(bytes);
  char& verdict = shared.bytes().back();
  const pid_t copy = ::fork();
  if (copy < 0) return {false, {}, std::string("cannot be started: ") + std::strerror(errno)};
  if (copy == 0) run_copy(made, verdict, work, deadline);
  int status = 0;
  while (::waitpid(copy, &status, 0) < 0 && errno == EINTR) {
  }
  const auto found = static_cast<Verdict>(verdict);
  if (found == Verdict::Done) return {true, {made.begin(), made.end()}, {}};
  return {false, {}, end_of(status, found)};
}

}  // namespace af
