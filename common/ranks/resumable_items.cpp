// SPDX-License-Identifier: Apache-2.0
#include "ranks/resumable_items.h"

#include <algorithm>
#include <array>
#include <optional>

#include "base/error.h"
#include "ranks/progress_printer.h"
#include "ranks/root_only.h"
#include "ranks/stop_request.h"
#include "ranks/terminal.h"
#include "ranks/work_queue.h"
#include "ranks/work_watch.h"

namespace af {
namespace {

std::string of_all(std::size_t part, std::size_t all) {
  return std::to_string(part) + " of " + std::to_string(all);
}

}  // namespace

ResumableItems::ResumableItems(const UnfinishedWork& work, const Communicator& communicator)
    : communicator_(communicator), store_(work, communicator) {
  do_on_root(communicator_, [&] {
    store_.visit([&](std::int64_t item, std::span<const std::byte>) { finished_.push_back(item); });
    std::sort(finished_.begin(), finished_.end());
  });
}

std::vector<std::int64_t> ResumableItems::unfinished(const std::vector<std::int64_t>& items) const {
  const auto find_finished = [&] {
    std::vector<std::byte> flags(items.size());
    for (std::size_t i = 0; i < items.size(); ++i)
      flags[i] = std::byte{std::binary_search(finished_.begin(), finished_.end(), items[i])};
    return flags;
  };
  const std::vector<std::byte> flags = on_root(communicator_, find_finished).share().take();
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
        store_.shard().append(item, {work(item)});
        ++saved_;
      },
      [&](std::int64_t done) {
        if (printer) printer->update(static_cast<double>(done), static_cast<double>(to_do.size()));
      });
  save(what);
}

void ResumableItems::save(const std::string& what) {
  all_or_none(communicator_, [&] { store_.shard().sync(); });
  if (!is_stop_requested(communicator_)) return;
  std::array<std::uint64_t, 1> saved = {saved_};
  communicator_.sum(saved);
  do_on_root(communicator_, [&] {
    throw StoppedError("stopped" + (what.empty() ? "" : ", " + what) + ": " +
                       of_all(saved[0], items_.size()) +
                       " saved: run the same command again to go on");
  });
}

void ResumableItems::visit(const Receive& receive) const {
  std::vector<bool> is_there(items_.size());
  store_.visit([&](std::int64_t item, std::span<const std::byte> result) {
    const auto place = std::lower_bound(items_.begin(), items_.end(), item);
    if (place == items_.end() || *place != item) return;
    is_there[static_cast<std::size_t>(place - items_.begin())] = true;
    receive(item, result);
  });
  const auto lost = std::count(is_there.begin(), is_there.end(), false);
  if (lost > 0)
    throw FileError(
        store_.folder().string(),
        std::to_string(lost) + " finished items are no longer there: run the same command again");
}

}  // namespace af
