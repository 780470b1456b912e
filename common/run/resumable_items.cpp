// SPDX-License-Identifier: Apache-2.0
#include "run/resumable_items.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <optional>

#include "base/error.h"
#include "parallel/work_queue.h"
#include "parallel/work_watch.h"
#include "run/progress_printer.h"
#include "run/stop_request.h"
#include "run/terminal.h"

namespace af {
namespace {

/// A record is the item's number, then its result.
std::int64_t item_of(std::span<const std::byte> record, const std::filesystem::path& folder) {
  std::int64_t item = 0;
  if (record.size() < sizeof(item))
    throw FileError(folder.string(),
                    "damaged (a record without a number): start over with --restart");
  std::memcpy(&item, record.data(), sizeof(item));
  return item;
}

std::string of_all(std::size_t part, std::size_t all) {
  return std::to_string(part) + " of " + std::to_string(all);
}

}  // namespace

ResumableItems::ResumableItems(const UnfinishedWork& work, const Communicator& communicator)
    : folder_(work.folder), communicator_(communicator) {
  std::array<std::uint64_t, 1> run{};
  all_or_none(communicator_, [&] {
    if (!communicator_.is_root()) return;
    journal_ =
        std::make_unique<ProgressJournal>(work.folder, work.name, work.decides, work.restarts);
    journal_->mend_and_visit(
        [&](std::span<const std::byte> record) { finished_.push_back(item_of(record, folder_)); });
    std::sort(finished_.begin(), finished_.end());
    run[0] = static_cast<std::uint64_t>(journal_->run());
  });
  communicator_.maximum(run);
  shard_.emplace(work.folder, work.name, static_cast<int>(run[0]), communicator_.rank());
}

std::vector<std::int64_t> ResumableItems::unfinished(const std::vector<std::int64_t>& items) const {
  std::vector<std::byte> flags(items.size());
  if (communicator_.is_root())
    for (std::size_t i = 0; i < items.size(); ++i)
      flags[i] = std::byte{std::binary_search(finished_.begin(), finished_.end(), items[i])};
  communicator_.broadcast(flags);
  std::vector<std::int64_t> left;
  left.reserve(static_cast<std::size_t>(std::count(flags.begin(), flags.end(), std::byte{0})));
  for (std::size_t i = 0; i < items.size(); ++i)
    if (flags[i] == std::byte{0}) left.push_back(items[i]);
  return left;
}

void ResumableItems::complete(const std::vector<std::int64_t>& items,
                              const std::string& what,
                              const Work& work) {
  const std::vector<std::int64_t> to_do = unfinished(items);
  const std::size_t all = items.size();
  const std::size_t done_before = all - to_do.size();
  saved_ = communicator_.is_root() ? done_before : 0;
  if (communicator_.is_root()) items_ = items;
  if (done_before > 0 && !what.empty())
    inform(communicator_, what + ": goes on after " + of_all(done_before, all));
  std::optional<ProgressPrinter> printer;
  if (!what.empty()) printer.emplace(what, communicator_.is_root());
  for_each_item(
      communicator_,
      static_cast<std::int64_t>(to_do.size()),
      [&](std::int64_t place) {
        if (is_stop_requested()) return;
        const std::int64_t item = to_do[static_cast<std::size_t>(place)];
        const WorkNote note((what.empty() ? "" : what + ": ") + "item " + std::to_string(item) +
                            " (" + of_all(done_before + static_cast<std::size_t>(place) + 1, all) +
                            ")");
        append(item, work(item));
      },
      [&](std::int64_t done) {
        if (printer) printer->update(static_cast<double>(done), static_cast<double>(to_do.size()));
      });
  save(what);
}

void ResumableItems::append(std::int64_t item, std::span<const std::byte> result) {
  record_.resize(sizeof(item) + result.size());
  std::memcpy(record_.data(), &item, sizeof(item));
  std::copy(result.begin(), result.end(), record_.begin() + sizeof(item));
  shard_->append(record_);
  ++saved_;
}

void ResumableItems::save(const std::string& what) {
  all_or_none(communicator_, [&] { shard_->sync(); });
  // Ranks may see the request at different times; it is enough that one has seen it.
  std::array<std::uint64_t, 1> stops = {is_stop_requested() ? 1U : 0U};
  communicator_.maximum(stops);
  if (stops[0] == 0) return;
  std::array<std::uint64_t, 1> saved = {saved_};
  communicator_.sum(saved);
  all_or_none(communicator_, [&] {
    if (communicator_.is_root())
      throw StoppedError("stopped" + (what.empty() ? "" : ", " + what) + ": " +
                         of_all(saved[0], items_.size()) +
                         " saved: run the same command again to go on");
  });
}

void ResumableItems::visit(const Receive& receive) const {
  std::vector<bool> is_there(items_.size());
  journal_->visit(communicator_.size(), [&](std::span<const std::byte> record) {
    const std::int64_t item = item_of(record, folder_);
    const auto place = std::lower_bound(items_.begin(), items_.end(), item);
    if (place == items_.end() || *place != item) return;
    is_there[static_cast<std::size_t>(place - items_.begin())] = true;
    receive(item, record.subspan(sizeof(item)));
  });
  const auto lost = std::count(is_there.begin(), is_there.end(), false);
  if (lost > 0)
    throw FileError(
        folder_.string(),
        std::to_string(lost) + " finished items are no longer there: run the same command again");
}

}  // namespace af
