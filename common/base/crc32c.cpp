// SPDX-License-Identifier: Apache-2.0
#include "base/crc32c.h"

#include <cstring>

#include "base/processor.h"

namespace af {

std::uint32_t crc32c(std::span<const std::byte> bytes, std::uint32_t previous) {
  std::uint64_t crc = ~previous;
  std::size_t i = 0;
  for (; i + 8 <= bytes.size(); i += 8) {
    std::uint64_t word = 0;
    std::memcpy(&word, bytes.data() + i, sizeof(word));
    crc = processor::crc32c_of_word(crc, word);
  }
  auto tail = static_cast<std::uint32_t>(crc);
  for (; i < bytes.size(); ++i)
    tail = processor::crc32c_of_byte(tail, std::to_integer<std::uint8_t>(bytes[i]));
  return ~tail;
}

}  // namespace af
