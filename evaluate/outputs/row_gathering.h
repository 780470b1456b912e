// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>

#include "parallel/communicator.h"
#include "run/resumable_items.h"

namespace af::evaluation {

/// Collective. The rows of items 0 ... count - 1 that no earlier run has finished, shared over the
/// ranks and kept (see ResumableItems); then `receive` gets every item's row on rank 0, in any
/// order. Rows are kept as CBOR: doubles keep every bit, NaN and infinity. Rank 0 prints the
/// progress of `what`, unless that is empty.
void collect_rows(const Communicator& world,
                  const UnfinishedWork& unfinished,
                  std::int64_t count,
                  const std::string& what,
                  const std::function<nlohmann::json(std::int64_t item)>& row_of_item,
                  const std::function<void(std::int64_t item, const nlohmann::json& row)>& receive);

/// Rank 0 does one item, discards the result, and says how long `count` of them will take on all
/// ranks. When the item fails, nothing is said: the run itself will report why.
void announce_time(const Communicator& world,
                   const std::string& what,
                   std::int64_t count,
                   const std::function<void()>& item);

}  // namespace af::evaluation
