// SPDX-License-Identifier: Apache-2.0
#include "files/output_lock.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <cstdlib>
#include <ctime>
#include <fcntl.h>
#include <fstream>
#include <mutex>
#include <set>
#include <sstream>
#include <string>
#include <sys/stat.h>
#include <system_error>
#include <unistd.h>
#include <utility>

#include "base/error.h"
#include "base/host_name.h"

namespace af {

namespace {

namespace fs = std::filesystem;

std::atomic<bool> works_without_locks = false;

std::string text_of_environment(const char* name) {
  const char* const value = std::getenv(name);
  return value == nullptr ? "" : value;
}

/// The batch job, with its task where it is one of an array.
std::string batch_job() {
  const std::string array = text_of_environment("SLURM_ARRAY_JOB_ID");
  const std::string slurm = array.empty()
                                ? text_of_environment("SLURM_JOB_ID")
                                : array + "_" + text_of_environment("SLURM_ARRAY_TASK_ID");
  if (!slurm.empty()) return "slurm " + slurm;
  const std::string pbs = text_of_environment("PBS_JOBID");
  return pbs.empty() ? "" : "pbs " + pbs;
}

std::string time_text() {
  const std::time_t now = std::time(nullptr);
  std::tm utc{};
  gmtime_r(&now, &utc);
  std::array<char, 32> text{};
  std::strftime(text.data(), text.size(), "%Y-%m-%d %H:%M:%S UTC", &utc);
  return text.data();
}

std::string own_command() {
  std::ifstream file("/proc/self/cmdline", std::ios::binary);
  std::string command;
  std::getline(file, command, '\n');
  for (char& character : command)
    if (character == '\0') character = ' ';
  while (!command.empty() && command.back() == ' ') command.pop_back();
  constexpr std::size_t kLongest = 500;
  return command.substr(0, kLongest);
}

/// Who holds a lock: the lines of its file.
struct Holder {
  std::string host;
  std::string job;    ///< "slurm 123_4"; empty without a batch system
  std::string words;  ///< who it is, for people

  static Holder this_process() {
    Holder holder{host_name(), batch_job(), {}};
    holder.words = "process " + std::to_string(getpid()) + " on " + holder.host +
                   (holder.job.empty() ? "" : ", job " + holder.job) + ", since " + time_text() +
                   " (" + own_command() + ")";
    return holder;
  }
  [[nodiscard]] std::string text() const { return host + "\n" + job + "\n" + words + "\n"; }
};

/// As a message may show it: another user may have written the file.
std::string printable(std::string text) {
  constexpr std::size_t kLongest = 1000;
  text.resize(std::min(text.size(), kLongest));
  for (char& character : text)
    if (static_cast<unsigned char>(character) < 0x20 || character == 0x7f) character = '?';
  return text;
}

/// Of an open lock; without words when nobody has written into it yet. FileError when the file,
/// which nobody holds, is anything else than a lock.
Holder holder_of(int descriptor, const fs::path& path, bool is_held) {
  constexpr std::size_t kMostBytes = 4096;
  std::string text(kMostBytes, '\0');
  const ssize_t bytes = pread(descriptor, text.data(), text.size(), 0);
  text.resize(bytes > 0 ? static_cast<std::size_t>(bytes) : 0);
  if (text.empty()) return {};
  std::istringstream lines(text);
  Holder holder;
  std::getline(lines, holder.host);
  std::getline(lines, holder.job);
  std::getline(lines, holder.words);
  if (!is_held && !holder.words.starts_with("process "))
    throw FileError(path.string(),
                    "is not the lock of an output: rename it, or choose another output");
  holder.words = printable(holder.words);
  return holder;
}

enum class Locked { Yes, ByAnother, NotSupported };

Locked lock_by_kernel(int descriptor, const fs::path& path) {
  struct flock lock {};
  lock.l_type = F_WRLCK;
  lock.l_whence = SEEK_SET;
  if (fcntl(descriptor, F_OFD_SETLK, &lock) == 0) return Locked::Yes;
  if (errno == EAGAIN || errno == EACCES) return Locked::ByAnother;
  if (errno == ENOSYS || errno == EOPNOTSUPP || errno == ENOLCK || errno == EINVAL)
    return Locked::NotSupported;
  throw FileError(path.string(), "cannot be locked: " + std::generic_category().message(errno));
}

/// Whether the open file is still the one of that name: its holder removes it when done.
bool is_current(int descriptor, const fs::path& path) {
  struct stat open_file {};
  struct stat named {};
  return fstat(descriptor, &open_file) == 0 && stat(path.c_str(), &named) == 0 &&
         open_file.st_ino == named.st_ino && open_file.st_dev == named.st_dev;
}

void write_text(int descriptor, const std::string& text, const fs::path& path) {
  const bool is_written =
      ftruncate(descriptor, 0) == 0 &&
      pwrite(descriptor, text.data(), text.size(), 0) == static_cast<ssize_t>(text.size()) &&
      (fsync(descriptor) == 0 || errno == EINVAL);
  if (is_written) return;
  const std::string reason = std::generic_category().message(errno);
  ::unlink(path.c_str());
  throw FileError(path.string(), "cannot be written: " + reason);
}

/// FileError when something else has the name of the lock.
void require_lock_is_a_file(const fs::path& path) {
  struct stat named {};
  if (lstat(path.c_str(), &named) == 0 && !S_ISREG(named.st_mode))
    throw FileError(path.string(),
                    "is not a regular file, so it cannot be the lock of the output: remove it, or "
                    "choose another output");
}

/// Who has a lock that may only be read: another user's, for example.
std::string readable_holder(const fs::path& path) {
  const int descriptor = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK);
  if (descriptor < 0) return {};
  const Holder holder = holder_of(descriptor, path, true);
  ::close(descriptor);
  return holder.words.empty() ? "" : "; it is the lock of " + holder.words;
}

[[noreturn]] void refuse(const fs::path& output,
                         const fs::path& lock,
                         const Holder& holder,
                         bool is_held) {
  const std::string who =
      holder.words.empty() ? "a job that has not identified itself yet" : holder.words;
  throw InputError(
      "output",
      output.string(),
      is_held
          ? "another job is writing it: " + who +
                "; wait until it ends, stop it, or choose another output"
          : "another job started writing it and did not end properly: " + who +
                "; whether it is still running cannot be told from here: if it is not, remove " +
                lock.string() + ", or give --no-lock, and run the same command again");
}

/// The outputs that this process has locked.
class OwnLocks {
 public:
  static OwnLocks& instance() {
    static auto* const locks = new OwnLocks;  // outlives every lock, of other statics, too
    return *locks;
  }

  void add(const fs::path& output) {
    const std::scoped_lock lock(mutex_);
    outputs_.insert(output);
  }
  void remove(const fs::path& output) {
    const std::scoped_lock lock(mutex_);
    outputs_.erase(output);
  }
  /// Whether a folder around it is locked.
  bool cover(const fs::path& output) {
    const std::scoped_lock lock(mutex_);
    for (fs::path folder = output.parent_path(); folder != folder.root_path();
         folder = folder.parent_path()) {
      const fs::path extension = folder.extension();
      const bool is_work = extension == ".partial" || extension == ".progress";
      if (outputs_.contains(folder) ||
          (is_work && outputs_.contains(folder.parent_path() / folder.stem())))
        return true;
    }
    return false;
  }

 private:
  std::mutex mutex_;
  std::set<fs::path> outputs_;
};

fs::path without_trailing_slash(const fs::path& path) {
  const fs::path normal = path.lexically_normal();
  return normal.has_filename() ? normal : normal.parent_path();
}

}  // namespace

OutputLock::OutputLock(const fs::path& output) : OutputLock() {
  const fs::path absolute = without_trailing_slash(fs::absolute(output));
  if (works_without_locks || OwnLocks::instance().cover(absolute)) return;
  path_ = without_trailing_slash(output) += ".lock";
  while (!try_to_take(output)) ::close(std::exchange(descriptor_, -1));
  output_ = absolute;
  OwnLocks::instance().add(output_);
}

OutputLock::OutputLock(OutputLock&& other) noexcept
    : path_(std::move(other.path_)),
      output_(std::move(other.output_)),
      descriptor_(std::exchange(other.descriptor_, -1)) {}

bool OutputLock::try_to_take(const fs::path& output) {
  const bool is_new = open_file();
  const Locked locked = lock_by_kernel(descriptor_, path_);
  if (!is_current(descriptor_, path_)) return false;
  const Holder holder = holder_of(descriptor_, path_, locked == Locked::ByAnother);
  const Holder mine = Holder::this_process();
  const bool is_ours = holder.words.empty() || holder.host == mine.host ||
                       (!mine.job.empty() && holder.job == mine.job);
  const bool is_free = is_new ? locked != Locked::ByAnother : locked == Locked::Yes && is_ours;
  if (!is_free) refuse(output, path_, holder, locked == Locked::ByAnother);
  write_text(descriptor_, mine.text(), path_);
  return true;
}

bool OutputLock::open_file() {
  constexpr mode_t kMode = 0666;  // before the umask
  // Whatever has taken the name of the lock must not be followed, waited for or become a terminal.
  constexpr int kFlags = O_RDWR | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK | O_NOCTTY;
  while (true) {
    descriptor_ = ::open(path_.c_str(), kFlags | O_CREAT | O_EXCL, kMode);
    if (descriptor_ >= 0) return true;
    if (errno == EEXIST) {
      require_lock_is_a_file(path_);
      descriptor_ = ::open(path_.c_str(), kFlags);
      if (descriptor_ >= 0) return false;
      if (errno == ENOENT) continue;  // removed in between: once more
    }
    const std::string reason = std::generic_category().message(errno);
    throw FileError(path_.string(),
                    "cannot be opened for writing: " + reason + readable_holder(path_));
  }
}

OutputLock::~OutputLock() {
  if (descriptor_ < 0) return;
  if (!output_.empty()) {
    OwnLocks::instance().remove(output_);
    // If somebody removed the file meanwhile, another job may have made it anew.
    if (is_current(descriptor_, path_)) ::unlink(path_.c_str());
  }
  ::close(descriptor_);
}

void write_without_locks() {
  works_without_locks = true;
}

}  // namespace af
