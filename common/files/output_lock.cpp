// SPDX-License-Identifier: Apache-2.0
#include "files/output_lock.h"

#include <array>
#include <atomic>
#include <cerrno>
#include <cstdlib>
#include <ctime>
#include <fcntl.h>
#include <fstream>
#include <mutex>
#include <set>
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

/// The batch job; empty without a batch system.
std::string batch_job() {
  for (const char* name : {"SLURM_JOB_ID", "PBS_JOBID"})
    if (const char* const value = std::getenv(name)) return value;
  return {};
}

std::string time_text() {
  const std::time_t now = std::time(nullptr);
  std::tm utc{};
  gmtime_r(&now, &utc);
  std::array<char, 32> text{};
  std::strftime(text.data(), text.size(), "%Y-%m-%d %H:%M:%S UTC", &utc);
  return text.data();
}

/// The parts of a lock's text that identify its holder.
std::string on_this_host() {
  return " on " + host_name() + ",";
}
std::string of_this_job() {
  const std::string job = batch_job();
  return job.empty() ? "" : " job " + job + ",";
}

/// The text of a lock, which tells people who holds it.
std::string this_process() {
  return "process " + std::to_string(getpid()) + on_this_host() + of_this_job() + " since " +
         time_text();
}

/// The text of a lock, made safe for messages, since another user may have written the file. Empty
/// when nobody has written into it yet.
std::string holder_of(const fs::path& path) {
  constexpr std::size_t kLongest = 1000;
  std::string text(kLongest, '\0');
  std::ifstream file(path, std::ios::binary);
  file.read(text.data(), static_cast<std::streamsize>(text.size()));
  text.resize(static_cast<std::size_t>(file.gcount()));
  if (text.ends_with('\n')) text.pop_back();
  for (char& character : text)
    if (static_cast<unsigned char>(character) < 0x20 || character == 0x7f) character = '?';
  return text;
}

/// Whether a lock that nobody holds was left by a process that has certainly ended.
bool is_of_ended_process(const std::string& holder) {
  if (holder.empty()) return true;
  const std::string job = of_this_job();
  return holder.starts_with("process ") &&
         (holder.find(on_this_host()) != std::string::npos ||
          (!job.empty() && holder.find(job) != std::string::npos));
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

/// Whether the open file still has that name: its holder removes it when done.
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

/// Throws FileError when something else has the name of the lock.
void require_lock_is_a_file(const fs::path& path) {
  struct stat named {};
  if (lstat(path.c_str(), &named) == 0 && !S_ISREG(named.st_mode))
    throw FileError(path.string(),
                    "is not a regular file, so it cannot be the lock of the output: remove it, or "
                    "choose another output");
}

[[noreturn]] void refuse(const fs::path& output,
                         const fs::path& lock,
                         const std::string& holder,
                         bool is_held) {
  if (is_held)
    throw InputError("output",
                     output.string(),
                     "another job is writing it: " +
                         (holder.empty() ? "a job that has not identified itself yet" : holder) +
                         " (" + lock.string() +
                         "); wait until it ends, stop it, or choose another output");
  if (!holder.starts_with("process "))
    throw FileError(lock.string(),
                    "is not the lock of an output: rename it, or choose another output");
  throw InputError("output",
                   output.string(),
                   "another job started writing it and did not end properly: " + holder +
                       "; whether it is still running cannot be told from here: if it is not, "
                       "remove " +
                       lock.string() + ", or give --no-lock, and run the same command again");
}

/// The outputs that this process has locked.
class OwnLocks {
 public:
  static OwnLocks& instance() {
    static auto* const locks =
        new OwnLocks;  // outlives every lock, including those of other statics
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
  const std::string holder = holder_of(path_);
  const bool is_free =
      is_new ? locked != Locked::ByAnother : locked == Locked::Yes && is_of_ended_process(holder);
  if (!is_free) refuse(output, path_, holder, locked == Locked::ByAnother);
  write_text(descriptor_, this_process() + "\n", path_);
  return true;
}

bool OutputLock::open_file() {
  constexpr mode_t kMode = 0666;  // before the umask
  // Whatever has taken the name of the lock must not be followed, waited for or made a terminal.
  constexpr int kFlags = O_RDWR | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK | O_NOCTTY;
  while (true) {
    descriptor_ = ::open(path_.c_str(), kFlags | O_CREAT | O_EXCL, kMode);
    if (descriptor_ >= 0) return true;
    if (errno == EEXIST) {
      require_lock_is_a_file(path_);
      descriptor_ = ::open(path_.c_str(), kFlags);
      if (descriptor_ >= 0) return false;
      if (errno == ENOENT) continue;  // removed in between: try again
    }
    const std::string reason = std::generic_category().message(errno);
    const std::string holder = holder_of(path_);
    throw FileError(path_.string(),
                    "cannot be opened for writing: " + reason +
                        (holder.empty() ? "" : "; it is the lock of " + holder));
  }
}

OutputLock::~OutputLock() {
  if (descriptor_ < 0) return;
  if (!output_.empty()) {
    OwnLocks::instance().remove(output_);
    // If somebody removed the file meanwhile, another job may have created it again.
    if (is_current(descriptor_, path_)) ::unlink(path_.c_str());
  }
  ::close(descriptor_);
}

void write_without_locks() {
  works_without_locks = true;
}

}  // namespace af
