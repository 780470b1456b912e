// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <functional>
#include <span>
#include <string>

#include "run/progress_manifest.h"

namespace af {

/// Finished records of unfinished work: FOLDER/NAME.json says what they are valid for; to
/// FOLDER/NAME.RUN-SHARD.records each process appends its own, each with its size and CRC-32C, so
/// that nothing passes through one process. Every run has files of its own: what a process of an
/// earlier run still writes, on a host that was lost and came back, meets nobody. Whatever a killed
/// run left torn or damaged is cut off when the journal is opened again. This side is for one
/// process alone.
class ProgressJournal {
 public:
  using Visit = std::function<void(std::span<const std::byte> record)>;

  /// Opens or creates a journal. InputError that names the difference when earlier records were
  /// about something else; `restart` throws them away. FileError when files cannot be read or
  /// written.
  ProgressJournal(const std::filesystem::path& folder,
                  const std::string& name,
                  const DecidingValues& decides,
                  bool restart);

  /// The number of this run, one more than any before.
  [[nodiscard]] int run() const { return run_; }

  /// The sound records of all shards, by shard and in the order in which they were appended. Shards
  /// 0 ... shard_count - 1 are looked for by name: a network file system may list late what another
  /// host has just made.
  void visit(int shard_count, const Visit& visit) const;

  /// The same of what earlier runs left; what follows the first unsound record of a shard is cut
  /// off. To be called before any process appends.
  void mend_and_visit(const Visit& visit);

  /// Removes the journal, and the folder when nothing else is in it: the work is complete.
  void remove();

 private:
  void open(const DecidingValues& decides, bool restart);

  std::filesystem::path folder_;
  std::string name_;
  int run_ = 0;
};

/// What one process appends to a journal that exists.
class ProgressShard {
 public:
  /// `run`: of the journal. Shards of one run must differ.
  ProgressShard(const std::filesystem::path& folder, const std::string& name, int run, int shard);

  /// The record survives the end of this process from now on; of the machine after sync(), or a
  /// minute later with the next record. FileError when it cannot be written.
  void append(std::span<const std::byte> record);

  void sync();

 private:
  std::filesystem::path path_;
  std::ofstream file_;
  std::chrono::steady_clock::time_point last_sync_;
};

}  // namespace af
