// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

namespace af {

/// Keeps other jobs from writing the same output: "OUTPUT.lock" beside it, locked by the kernel
/// (fcntl, of the open file), which lets go when this process ends, however it ends. The file says
/// who holds it. A lock left by a killed job is taken over where the kernel's word counts for every
/// host (local file systems, NFS, Lustre with `flock`, GPFS, Ceph), and elsewhere when its process
/// is known to be gone: of this host and its namespaces, or of this batch job before it was queued
/// again. \test OutputLock.OfAZombieIsKnownToBeGone
class OutputLock {
 public:
  /// InputError that says who holds it, since when and what to do; FileError when the file cannot
  /// be made or written, or is no regular file.
  explicit OutputLock(const std::filesystem::path& output);
  /// Removes the file, unless it is another job's by now.
  ~OutputLock();
  OutputLock(const OutputLock&) = delete;
  OutputLock& operator=(const OutputLock&) = delete;

 private:
  bool try_to_take(const std::filesystem::path& output);
  bool open_file();

  std::filesystem::path path_;
  int descriptor_ = -1;
};

/// Who holds a lock, as written into its file.
struct LockHolder {
  std::string host;
  int process = 0;
  std::uint64_t process_start = 0;  ///< ticks since the host's boot: numbers are used again
  std::string process_space;        ///< whose numbers these are: process_space()
  std::string job;                  ///< "slurm 123_4"; empty without a batch system
  std::string since;
  std::string command;
};

LockHolder this_process();
std::string to_json(const LockHolder& holder);
/// Nothing when the text is not of a holder.
std::optional<LockHolder> lock_holder_of(const std::string& json);

/// Whether a holder is gone for sure: its process, whose number means the same here, has ended, or
/// it was this batch job before that was queued again.
bool is_known_gone(const LockHolder& holder, const LockHolder& mine);

/// Whether locks on a file system are seen by every host that mounts it, by a line of
/// /proc/self/mountinfo.
bool locks_reach_other_hosts(const std::string& mountinfo_line);

/// The same by the type that statfs() gives: false for NFS and Lustre, whose mount options decide.
bool locks_reach_other_hosts(std::uint32_t file_system_magic);

}  // namespace af
