// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdio>
#include <string>

namespace af {

/// Like std::snprintf(), up to 511 bytes.
template <typename... Values>
std::string formatted(const char* format, Values... values) {
  std::array<char, 512> text{};
  const int length = std::snprintf(text.data(), text.size(), format, values...);
  return {text.data(), std::min(text.size() - 1, static_cast<std::size_t>(std::max(0, length)))};
}

/// "12.3 MB" (10^6 bytes).
inline std::string megabytes_text(std::uint64_t bytes) {
  const double megabytes = static_cast<double>(bytes) / 1e6;
  return formatted(megabytes < 10.0 ? "%.2f MB" : "%.1f MB", megabytes);
}

}  // namespace af
