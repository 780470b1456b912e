// SPDX-License-Identifier: Apache-2.0
#include "base/crc32c.h"

#include <cstring>

namespace af {

std::uint32_t crc32c(std::span<const std::byte> bytes, std::uint32_t previous) {
  // The SSE4.2 instruction: part of the x86-64-v2 baseline.
  std::uint64_t crc = ~previous;
  std::size_t i = 0;
  for (; i + 8 <= bytes.size(); i += 8) {
    std::uint64_t word = 0;
    std::memcpy(&word, bytes.data() + i, sizeof(word));
    crc = __builtin_ia32_crc32di(crc, word);
  }
  auto tail = static_cast<std::uint32_t>(crc);
  for (; i < bytes.size(); ++i)
    tail = __builtin_ia32_crc32qi(tail, static_cast<unsigned char>(bytes[i]));
  return ~tail;
}

}  // namespace af
