// SPDX-License-Identifier: Apache-2.0
#include "run/output_lock.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdlib>
#include <ctime>
#include <fcntl.h>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <sstream>
#include <stdexcept>
#include <sys/stat.h>
#include <sys/statfs.h>
#include <system_error>
#include <unistd.h>
#include <utility>

#include "base/error.h"
#include "run/process_state.h"

namespace af {

namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMostLockBytes = 64 << 10;

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

std::string host() {
  std::array<char, 256> name{};
  return gethostname(name.data(), name.size() - 1) == 0 ? name.data() : "unknown";
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
  constexpr std::size_t kLongest = 1000;
  return command.substr(0, kLongest);
}

/// The line of /proc/self/mountinfo for the file system that holds an open file; empty when there
/// is none: without /proc, and in a chroot whose root is no mount point.
std::string mount_line(int descriptor) {
  std::ifstream info("/proc/self/fdinfo/" + std::to_string(descriptor));
  std::string mount;
  for (std::string name; info >> name;)
    if (name == "mnt_id:") info >> mount;
  std::ifstream mounts("/proc/self/mountinfo");
  for (std::string line; std::getline(mounts, line);)
    if (!mount.empty() && line.rfind(mount + " ", 0) == 0) return line;
  return {};
}

/// A file system by both of its names: in /proc/self/mountinfo and of statfs().
struct FileSystem {
  const char* type;
  std::uint32_t magic;
};

/// Those whose locks are seen by every host that mounts them, however they are mounted: shared ones
/// that say so, and those of one host, for which there are no others.
constexpr std::array kLocksReach = {FileSystem{"gpfs", 0x47504653},
                                    FileSystem{"ceph", 0x00C36400},
                                    FileSystem{"ext2", 0xEF53},
                                    FileSystem{"ext3", 0xEF53},
                                    FileSystem{"ext4", 0xEF53},
                                    FileSystem{"xfs", 0x58465342},
                                    FileSystem{"btrfs", 0x9123683E},
                                    FileSystem{"zfs", 0x2FC12FC1},
                                    FileSystem{"f2fs", 0xF2F52010},
                                    FileSystem{"tmpfs", 0x01021994},
                                    FileSystem{"overlay", 0x794C7630}};

/// Asks the mount, which tells its options, and where it is not listed the file system itself.
bool locks_of_reach_other_hosts(int descriptor) {
  if (const std::string line = mount_line(descriptor); !line.empty())
    return locks_reach_other_hosts(line);
  struct statfs found {};
  return fstatfs(descriptor, &found) == 0 &&
         locks_reach_other_hosts(static_cast<std::uint32_t>(found.f_type));
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

std::string text_of(int descriptor) {
  std::string text(kMostLockBytes, '\0');
  const ssize_t bytes = pread(descriptor, text.data(), text.size(), 0);
  text.resize(bytes > 0 ? static_cast<std::size_t>(bytes) : 0);
  return text;
}

void write_text(int descriptor, const std::string& text, const fs::path& path) {
  const bool is_written =
      ftruncate(descriptor, 0) == 0 &&
      pwrite(descriptor, text.data(), text.size(), 0) == static_cast<ssize_t>(text.size()) &&
      (fsync(descriptor) == 0 || errno == EINVAL);
  if (!is_written)
    throw FileError(path.string(), "cannot be written: " + std::generic_category().message(errno));
}

/// As a message may show it: another user may have written the file.
std::string printable(std::string text) {
  constexpr std::size_t kLongest = 1000;
  text.resize(std::min(text.size(), kLongest));
  for (char& character : text)
    if (static_cast<unsigned char>(character) < 0x20 || character == 0x7f) character = '?';
  return text;
}

/// A number that the type holds; std::out_of_range for any other, such as 1e300.
template <typename T>
T whole_number(const nlohmann::json& json) {
  const bool is_natural = json.is_number_unsigned();
  const std::uint64_t value = is_natural ? json.get<std::uint64_t>() : 0;
  if (!is_natural || value > static_cast<std::uint64_t>(std::numeric_limits<T>::max()))
    throw std::out_of_range("not a whole number");
  return static_cast<T>(value);
}

std::string words_of(const LockHolder& holder) {
  return "process " + std::to_string(holder.process) + " on " + holder.host +
         (holder.job.empty() ? "" : ", job " + holder.job) + ", since " + holder.since + " (" +
         holder.command + ")";
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
  const std::optional<LockHolder> holder = lock_holder_of(text_of(descriptor));
  ::close(descriptor);
  return holder ? "; it is the lock of " + words_of(*holder) : "";
}

[[noreturn]] void refuse(const fs::path& output,
                         const fs::path& lock,
                         const std::optional<LockHolder>& holder,
                         bool is_held) {
  const std::string who = holder ? words_of(*holder) : "a job that has not identified itself yet";
  throw InputError(
      "output",
      output.string(),
      is_held
          ? "another job is writing it: " + who +
                "; wait until it ends, stop it, or choose another output"
          : "another job started writing it and did not end properly: " + who +
                "; whether it is still running cannot be told from here: if it is not, remove " +
                lock.string() + " and run the same command again");
}

}  // namespace

LockHolder this_process() {
  const int process = getpid();
  return {host(),
          process,
          process_start(process),
          process_space(),
          batch_job(),
          time_text(),
          own_command()};
}

std::string to_json(const LockHolder& holder) {
  return nlohmann::json{{"host", holder.host},
                        {"process", holder.process},
                        {"process_start", holder.process_start},
                        {"process_space", holder.process_space},
                        {"job", holder.job},
                        {"since", holder.since},
                        {"command", holder.command}}
             .dump(2, ' ', false, nlohmann::json::error_handler_t::replace) +
         "\n";
}

std::optional<LockHolder> lock_holder_of(const std::string& json) {
  try {
    const nlohmann::json holder = nlohmann::json::parse(json);
    return LockHolder{printable(holder.at("host").get<std::string>()),
                      whole_number<int>(holder.at("process")),
                      whole_number<std::uint64_t>(holder.at("process_start")),
                      holder.value("process_space", ""),
                      printable(holder.at("job").get<std::string>()),
                      printable(holder.at("since").get<std::string>()),
                      printable(holder.at("command").get<std::string>())};
  } catch (const nlohmann::json::exception&) {
    return std::nullopt;
  } catch (const std::out_of_range&) {
    return std::nullopt;
  }
}

bool is_known_gone(const LockHolder& holder, const LockHolder& mine) {
  const bool sees_it = holder.host == mine.host && holder.process_space == mine.process_space &&
                       !mine.process_space.empty();
  const ProcessState state =
      sees_it ? process_state(holder.process, holder.process_start) : ProcessState::NotTold;
  if (state != ProcessState::NotTold) return state == ProcessState::HasEnded;
  // A batch system does not run a job twice at a time.
  return !holder.job.empty() && holder.job == mine.job;
}

bool locks_reach_other_hosts(const std::string& mountinfo_line) {
  // "36 35 98:0 /root /mount options optional... - type source super-options"
  const std::size_t separator = mountinfo_line.find(" - ");
  if (separator == std::string::npos) return false;
  std::istringstream fields(mountinfo_line.substr(separator + 3));
  std::string type, source, options;
  fields >> type >> source >> options;
  const auto has = [&](const std::string& option) {
    return ("," + options + ",").find("," + option + ",") != std::string::npos;
  };
  if (type == "nfs" || type == "nfs4")
    return !has("nolock") && !has("local_lock=all") && !has("local_lock=posix");
  if (type == "lustre") return has("flock");
  return std::any_of(kLocksReach.begin(), kLocksReach.end(), [&](const FileSystem& known) {
    return type == known.type;
  });
}

bool locks_reach_other_hosts(std::uint32_t file_system_magic) {
  return std::any_of(kLocksReach.begin(), kLocksReach.end(), [&](const FileSystem& known) {
    return file_system_magic == known.magic;
  });
}

OutputLock::OutputLock(const fs::path& output) {
  fs::path name = output.lexically_normal();
  if (!name.has_filename()) name = name.parent_path();
  path_ = name += ".lock";
  while (!try_to_take(output)) {
  }
}

bool OutputLock::try_to_take(const fs::path& output) {
  const bool is_new = open_file();
  const Locked locked = lock_by_kernel(descriptor_, path_);
  const bool has_vanished = !is_current(descriptor_, path_);
  const LockHolder mine = this_process();
  const std::optional<LockHolder> holder = lock_holder_of(text_of(descriptor_));
  const bool reaches = locked == Locked::Yes && locks_of_reach_other_hosts(descriptor_);
  const bool is_left = reaches || (holder && is_known_gone(*holder, mine));
  const bool is_mine = locked != Locked::ByAnother && !has_vanished && (is_new || is_left);
  if (is_mine) {
    write_text(descriptor_, to_json(mine), path_);
    return true;
  }
  ::close(std::exchange(descriptor_, -1));
  if (!has_vanished) refuse(output, path_, holder, locked == Locked::ByAnother);
  return false;
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
  // If somebody removed the file meanwhile, another job may have made it anew.
  if (is_current(descriptor_, path_)) ::unlink(path_.c_str());
  ::close(descriptor_);
}

}  // namespace af
