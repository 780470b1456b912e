// SPDX-License-Identifier: Apache-2.0
#include "io/output_lock.h"

#include <array>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <ctime>
#include <fcntl.h>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <sys/stat.h>
#include <system_error>
#include <unistd.h>
#include <utility>

#include "base/error.h"
#include "io/output_file.h"

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

/// When a process of this host began; 0 when there is none.
std::uint64_t start_of(int process) {
  std::ifstream file("/proc/" + std::to_string(process) + "/stat");
  std::string stat;
  if (!std::getline(file, stat)) return 0;
  // Fields after the name, which may hold anything: 3 is the first, 22 the start.
  std::istringstream fields(stat.substr(std::min(stat.size(), stat.rfind(')') + 1)));
  std::string skipped;
  for (int field = 3; field < 22; ++field) fields >> skipped;
  std::uint64_t start = 0;
  fields >> start;
  return start;
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

/// The line of /proc/self/mountinfo for the file system that holds an open file.
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

std::string words_of(const LockHolder& holder) {
  return "process " + std::to_string(holder.process) + " on " + holder.host +
         (holder.job.empty() ? "" : ", job " + holder.job) + ", since " + holder.since + " (" +
         holder.command + ")";
}

[[noreturn]] void refuse(const fs::path& output,
                         const fs::path& lock,
                         const std::optional<LockHolder>& holder,
                         bool is_held) {
  const std::string who = holder ? words_of(*holder) : "a job that has not said its name yet";
  throw InputError(
      "output",
      output.string(),
      is_held ? "another job writes it: " + who +
                    "; wait for its end, stop it, or choose another output"
              : "another job has begun it and not ended it properly: " + who +
                    "; whether it still runs cannot be told from here: when it does not, remove " +
                    lock.string() + " and run the same command again");
}

}  // namespace

LockHolder this_process() {
  const int process = getpid();
  return {host(), process, start_of(process), batch_job(), time_text(), own_command()};
}

std::string to_json(const LockHolder& holder) {
  return nlohmann::json{{"host", holder.host},
                        {"process", holder.process},
                        {"process_start", holder.process_start},
                        {"job", holder.job},
                        {"since", holder.since},
                        {"command", holder.command}}
             .dump(2, ' ', false, nlohmann::json::error_handler_t::replace) +
         "\n";
}

std::optional<LockHolder> lock_holder_of(const std::string& json) {
  try {
    const nlohmann::json holder = nlohmann::json::parse(json);
    return LockHolder{holder.at("host").get<std::string>(),
                      holder.at("process").get<int>(),
                      holder.at("process_start").get<std::uint64_t>(),
                      holder.at("job").get<std::string>(),
                      holder.at("since").get<std::string>(),
                      holder.at("command").get<std::string>()};
  } catch (const nlohmann::json::exception&) {
    return std::nullopt;
  }
}

bool is_known_gone(const LockHolder& holder, const LockHolder& mine) {
  // A batch system does not run a job twice at a time.
  if (!holder.job.empty() && holder.job == mine.job) return true;
  return holder.host == mine.host && start_of(holder.process) != holder.process_start;
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
  for (const char* whole : {"gpfs", "ceph"})
    if (type == whole) return true;
  // Of one host alone: there are no others.
  for (const char* local :
       {"ext2", "ext3", "ext4", "xfs", "btrfs", "zfs", "tmpfs", "overlay", "f2fs"})
    if (type == local) return true;
  return false;
}

OutputLock::OutputLock(const fs::path& output) {
  fs::path name = output.lexically_normal();
  if (!name.has_filename()) name = name.parent_path();
  path_ = name += ".lock";
  std::error_code ignored;
  if (fs::exists(path_, ignored) && !fs::is_regular_file(path_, ignored))
    throw FileError(path_.string(), "exists and is not a regular file");
  while (!try_to_take(output)) {
  }
}

bool OutputLock::try_to_take(const fs::path& output) {
  const bool is_new = open_file();
  const Locked locked = lock_by_kernel(descriptor_, path_);
  const bool has_vanished = !is_current(descriptor_, path_);
  const LockHolder mine = this_process();
  const std::optional<LockHolder> holder = lock_holder_of(text_of(descriptor_));
  const bool reaches = locked == Locked::Yes && locks_reach_other_hosts(mount_line(descriptor_));
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
  constexpr int kFlags = O_RDWR | O_CLOEXEC | O_NOFOLLOW;
  while (true) {
    descriptor_ = ::open(path_.c_str(), kFlags | O_CREAT | O_EXCL, kMode);
    if (descriptor_ >= 0) return true;
    if (errno == EEXIST) descriptor_ = ::open(path_.c_str(), kFlags);
    if (descriptor_ >= 0) return false;
    if (errno != ENOENT)  // removed in between: once more
      throw FileError(path_.string(),
                      "cannot be opened: " + std::generic_category().message(errno));
  }
}

OutputLock::~OutputLock() {
  if (descriptor_ < 0) return;
  ::unlink(path_.c_str());
  ::close(descriptor_);
}

}  // namespace af
