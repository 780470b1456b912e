// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>

#include "ranks/communicator.h"

namespace af {

/// Hands out item numbers 0 ... count - 1 to the ranks as they become free, each exactly once, in
/// shrinking blocks. Rank 0 answers requests and works too, in a thread of its own, so `work` must
/// not call MPI. The result of an item must not depend on the rank that computes it.
/// Collective: returns on every rank when all items are done. When `work` throws on one rank, no
/// further items are handed out, and every rank throws the error. The same holds for `on_progress`,
/// which is called on rank 0, outside that thread, with the number of finished items.
void for_each_item(const Communicator& communicator,
                   std::int64_t count,
                   const std::function<void(std::int64_t item)>& work,
                   const std::function<void(std::int64_t done)>& on_progress = {});

/// How many items a rank is given at a time; at least one. A quarter of its share of what is left
/// lets all ranks finish together. It is no more than ranks have been seen to do in two seconds, so
/// that progress is known, and one while nothing is known.
/// \test BlockSize.ShrinksTowardsTheEndAndLastsTwoSecondsAtMost
std::int64_t block_size(std::int64_t items_left,
                        std::int64_t items_done,
                        int ranks,
                        double elapsed_seconds);

}  // namespace af
