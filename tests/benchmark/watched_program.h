// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace af::benchmark {

struct WatchedRun {
  int exit_code = -1;  ///< -1: ended by a signal
  double seconds = 0.0;
  std::uint64_t peak_bytes = 0;  ///< 0 when memory was not watched
};

enum class WatchMemory { No, Yes };

/// Runs a command (no shell) with its output in `log`. With WatchMemory::Yes it adds up the
/// proportional set sizes (PSS) of all processes named `process_name` below it, 20 times a second.
/// In these, memory that ranks share counts once. Watching slows the program down, so its seconds
/// are no timing.
WatchedRun run_watched(const std::vector<std::string>& command,
                       const std::filesystem::path& log,
                       const std::string& process_name,
                       WatchMemory watch_memory);

/// Drops a file's pages from the page cache, so that the next reading comes from the disk.
void forget_cached_pages(const std::filesystem::path& path);

}  // namespace af::benchmark
