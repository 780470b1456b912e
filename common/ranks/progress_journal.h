// SPDX-License-Identifier: Apache-2.0
// The one store of unfinished work, for small rows of an evaluation as well as for large blocks of
// a field.
#pragma once

#include <chrono>
#include <compare>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <functional>
#include <initializer_list>
#include <span>
#include <string>
#include <tuple>
#include <vector>

#include "ranks/deciding_values.h"

namespace af {

/// Work as a new run begins it, or as a later run continues it.
struct UnfinishedWork {
  std::filesystem::path folder;  ///< "OUTPUT.progress": RunFolder::unfinished()
  std::string name;              ///< of its files; several journals may share a folder
  DecidingValues decides;        ///< what every result depends on
  std::int64_t unit_size =
      0;                   ///< size of the parts it is cut into; later runs keep the first one's
  bool gives_way = false;  ///< when it cannot be continued, it is discarded instead of refused
  bool restarts = false;   ///< discard any earlier progress
};

/// What one process has written in one run.
struct JournalShard {
  std::int64_t run = 0;
  std::int64_t rank = 0;

  auto members() { return std::tie(run, rank); }
  auto operator<=>(const JournalShard&) const = default;
};

/// Where a record lies that has a sound header. Its content may be damaged.
struct RecordPlace {
  JournalShard shard;
  std::uint64_t offset = 0;
  std::int64_t key = 0;
  std::uint64_t bytes = 0;  ///< of its content

  auto operator<=>(const RecordPlace&) const = default;
};

/// The files of a journal. FOLDER/NAME.json says what it is valid for. Each process appends its
/// finished records to its own FOLDER/NAME.RUN-RANK.records, so that nothing passes through one
/// process.
/// A record has a key, its size, and CRC-32Cs of its header and its content. A reader reaches a
/// record through the headers before it. A torn or damaged header therefore ends its file, while
/// damaged content costs only that record. Nobody appends to the files of an earlier run: if a
/// process of such a run still writes, on a host that was lost and came back, it damages nothing.
struct JournalFiles {
  std::filesystem::path folder;
  std::string name;

  [[nodiscard]] std::filesystem::path manifest() const;
  [[nodiscard]] std::filesystem::path shard(const JournalShard& shard) const;

  /// In order. Files with names that no run can have are ignored.
  [[nodiscard]] std::vector<JournalShard> shards() const;
  /// The records of a shard, by their headers. None when it does not exist or is no regular file.
  [[nodiscard]] std::vector<RecordPlace> records(const JournalShard& shard) const;
  /// Reads a record's content into parts, which together have its size. False when it is damaged.
  [[nodiscard]] bool read(const RecordPlace& place,
                          std::initializer_list<std::span<std::byte>> parts) const;
};

/// Whether a journal's manifest lies in a folder.
bool holds_progress_journal(const std::filesystem::path& folder);

/// A journal as one process opens or creates it.
class ProgressJournal {
 public:
  using Visit = std::function<void(std::int64_t key, std::span<const std::byte> content)>;

  /// Throws InputError that names the difference when earlier records were about something else and
  /// do not give way, FileError when files cannot be read or written.
  explicit ProgressJournal(const UnfinishedWork& work);

  [[nodiscard]] const JournalFiles& files() const { return files_; }
  /// The number of this run, one more than any before.
  [[nodiscard]] std::int64_t run() const { return run_; }
  /// The unit size of the work, as set by the run that began it.
  [[nodiscard]] std::int64_t unit_size() const { return unit_size_; }
  /// Whether work with other options was discarded.
  [[nodiscard]] bool has_replaced() const { return has_replaced_; }

  /// Visits the sound records by run, by rank and in the order in which they were appended. Ranks 0
  /// ... rank_count - 1 of this run are looked for by name, because a network file system may be
  /// late to list what another host has just made.
  void visit(int rank_count, const Visit& visit) const;

  /// Notes that the options of this work were refused, so that a later run with others may discard
  /// it.
  void give_way() const;

 private:
  void go_on_or_begin(const UnfinishedWork& work);
  bool takes_over(const UnfinishedWork& work);

  JournalFiles files_;
  std::int64_t run_ = 0;
  std::int64_t unit_size_ = 0;
  bool has_replaced_ = false;
};

/// What one process appends to a journal that exists.
class ProgressShard {
 public:
  ProgressShard(JournalFiles files, const JournalShard& shard);

  /// Appends a record of these parts. From now on it survives the end of this process. It survives
  /// a crash of the machine after sync(), or from the next record a minute later. Throws FileError
  /// when it cannot be written.
  RecordPlace append(std::int64_t key, std::initializer_list<std::span<const std::byte>> parts);

  void sync();
  void close() { file_.close(); }

  /// Asks the system to drop the file from its cache, so that reading shows what it costs.
  void forget_cached() const;

 private:
  JournalFiles files_;
  std::filesystem::path path_;
  RecordPlace next_;
  std::ofstream file_;
  std::chrono::steady_clock::time_point last_sync_ = std::chrono::steady_clock::now();
};

}  // namespace af
