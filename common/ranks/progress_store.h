// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <span>
#include <vector>

#include "ranks/communicator.h"
#include "ranks/progress_journal.h"

namespace af {

/// A journal of unfinished work that all ranks use: rank 0 opens it, each appends to a shard of its
/// own, and each can read any record of which it knows the place.
class ProgressStore {
 public:
  /// Collective. Opens or creates the journal; InputError and FileError as ProgressJournal.
  ProgressStore(const UnfinishedWork& work, const Communicator& communicator);

  [[nodiscard]] const std::filesystem::path& folder() const { return files_.folder; }
  /// As ProgressJournal::unit_size(), the same on every rank.
  [[nodiscard]] std::int64_t unit_size() const { return unit_size_; }
  /// Rank 0: as ProgressJournal::has_replaced() and visit().
  [[nodiscard]] bool has_replaced() const { return journal_->has_replaced(); }
  void visit(const ProgressJournal::Visit& visit) const;

  /// Collective. Where the records of earlier runs lie, by run, rank and the order in which they
  /// were appended, the same on every rank. The ranks share the reading of headers; contents may be
  /// damaged.
  [[nodiscard]] std::vector<RecordPlace> find() const;
  /// As JournalFiles::read().
  [[nodiscard]] bool read(const RecordPlace& place,
                          std::initializer_list<std::span<std::byte>> parts) const {
    return files_.read(place, parts);
  }

  /// This rank's.
  [[nodiscard]] ProgressShard& shard() { return *shard_; }
  [[nodiscard]] const ProgressShard& shard() const { return *shard_; }

  /// Rank 0 calls ProgressJournal::give_way(). Its failure is ignored: --restart helps.
  void give_way() const;

 private:
  JournalFiles files_;
  Communicator communicator_;
  std::optional<ProgressJournal> journal_;  ///< rank 0
  std::optional<ProgressShard> shard_;
  std::int64_t unit_size_ = 0;
};

}  // namespace af
