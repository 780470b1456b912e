// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

namespace af {

/// How the ranks that train one codebook combine their results. The algorithms never see MPI. All
/// ranks call in the same order.
struct CodebookReduction {
  /// Exact element-wise sums over the ranks, in place.
  std::function<void(std::span<std::uint64_t>)> sum;
  /// Every rank's bytes on every rank, in rank order.
  std::function<std::vector<std::vector<std::byte>>(std::span<const std::byte>)> all_gather;
  std::size_t rank = 0;  ///< this rank's place in that order
};

/// For one rank.
inline CodebookReduction serial_reduction() {
  return {[](std::span<std::uint64_t>) {},
          [](std::span<const std::byte> mine) {
            return std::vector<std::vector<std::byte>>{{mine.begin(), mine.end()}};
          },
          0};
}

}  // namespace af
