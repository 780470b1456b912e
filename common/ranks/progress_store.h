// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <span>
#include <tuple>
#include <vector>

#include "ranks/progress_journal.h"
#include "ranks/root_only.h"

namespace af {

/// A journal of unfinished work that all ranks use. Rank 0 opens it, each rank appends to a shard
/// of its own, and each can read any record whose place it knows.
class ProgressStore {
 public:
  /// Collective. Opens or creates the journal. Throws as ProgressJournal does.
  ProgressStore(const UnfinishedWork& work, const Communicator& communicator);

  [[nodiscard]] const std::filesystem::path& folder() const { return files_.folder; }
  /// Like ProgressJournal::unit_size(), the same on every rank.
  [[nodiscard]] std::int64_t unit_size() const { return opened_->unit_size; }
  /// Like ProgressJournal::has_replaced(), the same on every rank.
  [[nodiscard]] bool has_replaced() const { return opened_->has_replaced; }
  /// Rank 0: like ProgressJournal::visit().
  void visit(const ProgressJournal::Visit& visit) const;

  /// Collective. Where the records of earlier runs lie, by run, rank and the order in which they
  /// were appended, the same on every rank. The ranks share the reading of headers. Contents may be
  /// damaged.
  [[nodiscard]] std::vector<RecordPlace> find() const;
  /// Like JournalFiles::read().
  [[nodiscard]] bool read(const RecordPlace& place,
                          std::initializer_list<std::span<std::byte>> parts) const {
    return files_.read(place, parts);
  }

  /// This rank's shard.
  [[nodiscard]] ProgressShard& shard() { return shard_; }
  [[nodiscard]] const ProgressShard& shard() const { return shard_; }

  /// Rank 0 calls ProgressJournal::give_way(). Its failure is ignored, because --restart helps.
  void give_way() const;

 private:
  /// What rank 0 tells the others about the journal.
  struct OpenedJournal {
    std::int64_t run = 0;
    std::int64_t unit_size = 0;
    bool has_replaced = false;

    auto members() { return std::tie(run, unit_size, has_replaced); }
  };

  JournalFiles files_;
  Communicator communicator_;
  RootOnly<ProgressJournal> journal_;
  Shared<OpenedJournal> opened_;
  ProgressShard shard_;
};

}  // namespace af
