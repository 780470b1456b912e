// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <cstring>
#include <span>
#include <type_traits>
#include <vector>

#include "ranks/communicator.h"

namespace af {

/// Collective. The sum of a value over the ranks.
inline std::uint64_t sum_over(const Communicator& communicator, std::uint64_t value) {
  std::array<std::uint64_t, 1> total{value};
  communicator.sum(total);
  return total[0];
}

/// Collective. The values of all ranks on every rank, in rank order.
template <typename T>
std::vector<T> from_all(const std::vector<T>& mine, const Communicator& communicator) {
  static_assert(std::is_trivially_copyable_v<T>);
  std::vector<T> all;
  for (const auto& bytes : communicator.all_gather(std::as_bytes(std::span(mine)))) {
    const std::size_t before = all.size();
    all.resize(before + bytes.size() / sizeof(T));
    if (!bytes.empty()) std::memcpy(all.data() + before, bytes.data(), bytes.size());
  }
  return all;
}

}  // namespace af
