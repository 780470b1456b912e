// SPDX-License-Identifier: Apache-2.0
#include "ranks/progress_store.h"

#include <algorithm>
#include <array>

#include "base/error.h"
#include "ranks/values_of_ranks.h"

namespace af {

ProgressStore::ProgressStore(const UnfinishedWork& work, const Communicator& communicator)
    : files_{work.folder, work.name}, communicator_(communicator) {
  std::array<std::uint64_t, 2> run_and_unit_size{};
  all_or_none(communicator_, [&] {
    if (!communicator_.is_root()) return;
    journal_.emplace(work);
    run_and_unit_size = {static_cast<std::uint64_t>(journal_->run()),
                         static_cast<std::uint64_t>(journal_->unit_size())};
  });
  communicator_.maximum(run_and_unit_size);
  unit_size_ = static_cast<std::int64_t>(run_and_unit_size[1]);
  shard_.emplace(
      files_, JournalShard{static_cast<std::int64_t>(run_and_unit_size[0]), communicator_.rank()});
}

void ProgressStore::visit(const ProgressJournal::Visit& visit) const {
  journal_->visit(communicator_.size(), visit);
}

std::vector<RecordPlace> ProgressStore::find() const {
  std::vector<JournalShard> shards;
  all_or_none(communicator_, [&] {
    if (communicator_.is_root()) shards = files_.shards();
  });
  shards = from_all(shards, communicator_);
  std::vector<RecordPlace> places;
  all_or_none(communicator_, [&] {
    const auto ranks = static_cast<std::size_t>(communicator_.size());
    for (auto i = static_cast<std::size_t>(communicator_.rank()); i < shards.size(); i += ranks) {
      const std::vector<RecordPlace> more = files_.records(shards[i]);
      places.insert(places.end(), more.begin(), more.end());
    }
  });
  places = from_all(places, communicator_);
  std::sort(places.begin(), places.end());
  return places;
}

void ProgressStore::give_way() const {
  if (!communicator_.is_root()) return;
  try {
    journal_->give_way();
  } catch (const Error&) {
    // What the options were refused for is the error to tell.
  }
}

}  // namespace af
