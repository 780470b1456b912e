// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <numeric>
#include <span>
#include <string>
#include <vector>

#include "base/stored_bytes.h"
#include "ranks/resumable_items.h"
#include "ranks/root_only.h"

namespace af::evaluation {

/// Collective. The rows of items 0 ... count - 1. The ranks share the items that no earlier run has
/// finished, and save their rows (see ResumableItems). Rank 0 gets all rows, and other ranks get as
/// many empty ones. Rank 0 prints the progress of `what`, unless that is empty.
template <typename Row, typename RowOfItem>
std::vector<Row> collected_rows(const Communicator& world,
                                const UnfinishedWork& unfinished,
                                std::int64_t count,
                                const std::string& what,
                                const RowOfItem& row_of_item) {
  ResumableItems items(unfinished, world);
  std::vector<std::int64_t> all(static_cast<std::size_t>(count));
  std::iota(all.begin(), all.end(), 0);
  items.complete(all, what, [&](std::int64_t item) { return bytes_of<Row>(row_of_item(item)); });
  std::vector<Row> rows(all.size());
  do_on_root(world, [&] {
    items.visit([&](std::int64_t item, std::span<const std::byte> row) {
      rows[static_cast<std::size_t>(item)] = value_of<Row>(row, unfinished.folder.string());
    });
  });
  return rows;
}

/// Rank 0 works on a sample, which returns how many times as long an item takes, and says how long
/// `count` items will take on all ranks. When the sample fails, nothing is printed, because the run
/// itself will report why.
void announce_time(const Communicator& world,
                   const std::string& what,
                   std::int64_t count,
                   const std::function<double()>& sample);

}  // namespace af::evaluation
