// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstdint>

namespace af {

/// Most items of a block whose results travel to rank 0: few enough that they stay small in memory
/// and in one message.
inline constexpr std::int64_t kMostCollectedPerBlock = 64;

/// Items of the next block of a work queue: a quarter of a fair share of what is left, so that
/// blocks shrink towards the end and ranks finish together.
constexpr std::int64_t block_size(std::int64_t left, int ranks, std::int64_t most_per_block) {
  return std::clamp<std::int64_t>(left / (std::int64_t{4} * ranks), 1, most_per_block);
}

}  // namespace af
