// SPDX-License-Identifier: Apache-2.0
#include "ranks/progress_store.h"

#include <algorithm>

#include "base/error.h"
#include "ranks/values_of_ranks.h"

namespace af {

ProgressStore::ProgressStore(const UnfinishedWork& work, const Communicator& communicator)
    : files_{work.folder, work.name},
      communicator_(communicator),
      journal_(on_root(communicator, [&] { return ProgressJournal(work); })),
      opened_(
          journal_
              .then([](const ProgressJournal& journal) {
                return OpenedJournal{journal.run(), journal.unit_size(), journal.has_replaced()};
              })
              .share()),
      shard_(files_, JournalShard{opened_->run, communicator.rank()}) {}

void ProgressStore::visit(const ProgressJournal::Visit& visit) const {
  journal_.value().visit(communicator_.size(), visit);
}

std::vector<RecordPlace> ProgressStore::find() const {
  const std::vector<JournalShard> shards =
      on_root(communicator_, [&] { return files_.shards(); }).share();
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
    journal_.value().give_way();
  } catch (const Error&) {
    // The user should see the error for which the options were refused, not this one.
  }
}

}  // namespace af
