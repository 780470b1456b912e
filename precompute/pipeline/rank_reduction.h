// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "parallel/communicator.h"
#include "precompute/codebook/codebook_reduction.h"

namespace af {

/// How the ranks of a communicator, which must outlive it, combine their results.
inline CodebookReduction reduction_over(const Communicator& communicator) {
  return {
      [&communicator](std::span<std::uint64_t> values) { communicator.sum(values); },
      [&communicator](std::span<const std::byte> mine) { return communicator.all_gather(mine); },
      static_cast<std::size_t>(communicator.rank())};
}

}  // namespace af
