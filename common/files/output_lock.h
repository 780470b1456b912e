// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

namespace af {

/// Keeps other jobs from writing the same output. "OUTPUT.lock" beside it is locked by the kernel
/// (fcntl, on the open file), which lets go when this process ends, however it ends. The file says
/// who holds it, and is removed in the end.
/// A lock that a killed job left is taken over on the same host, or by the same batch job when it
/// is queued again. One from any other host is refused, because nobody can tell whether its holder
/// still runs. An output needs no lock of its own within a folder that this process has locked, or
/// within FOLDER.partial or FOLDER.progress. \test OutputLock.*
class OutputLock {
 public:
  /// Throws InputError that says who holds it, since when and what to do, FileError when the file
  /// cannot be created or written, or is not a lock.
  explicit OutputLock(const std::filesystem::path& output);
  OutputLock(OutputLock&& other) noexcept;
  OutputLock& operator=(OutputLock&&) = delete;
  ~OutputLock();

 private:
  OutputLock() = default;
  bool try_to_take(const std::filesystem::path& output);
  bool open_file();

  std::filesystem::path path_;    ///< path of the lock
  std::filesystem::path output_;  ///< absolute; empty: no lock is held
  int descriptor_ = -1;
};

/// From now on no lock is taken or heeded (--no-lock).
void write_without_locks();

}  // namespace af
