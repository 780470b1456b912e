// SPDX-License-Identifier: Apache-2.0
#include "base/toml_text.h"

namespace af {

namespace {

unsigned byte_at(std::string_view text, std::size_t position) {
  return position < text.size() ? static_cast<unsigned char>(text[position]) : 0;
}

/// Bytes of the UTF-8 character that begins here; 0 when none does (RFC 3629, table 3-7 of
/// Unicode).
std::size_t character_bytes(std::string_view text) {
  const unsigned first = byte_at(text, 0);
  const unsigned second = byte_at(text, 1);
  const auto continues = [&](std::size_t from, std::size_t bytes) {
    for (std::size_t i = from; i < bytes; ++i)
      if ((byte_at(text, i) & 0xC0u) != 0x80u) return std::size_t{0};
    return bytes;
  };
  if (first < 0x80) return 1;
  if (first < 0xC2 || first > 0xF4) return 0;
  if (first < 0xE0) return continues(1, 2);
  if (first < 0xF0) {
    const bool is_overlong = first == 0xE0 && second < 0xA0;
    const bool is_surrogate = first == 0xED && second > 0x9F;
    return is_overlong || is_surrogate ? 0 : continues(1, 3);
  }
  const bool is_overlong = first == 0xF0 && second < 0x90;
  const bool is_beyond = first == 0xF4 && second > 0x8F;
  return is_overlong || is_beyond ? 0 : continues(1, 4);
}

std::string escaped(char character) {
  constexpr const char* kHexDigits = "0123456789ABCDEF";
  const auto code = static_cast<unsigned char>(character);
  if (character == '"' || character == '\\') return {'\\', character};
  if (code >= 0x20 && code != 0x7F) return {character};
  return std::string("\\u00") + kHexDigits[code >> 4u] + kHexDigits[code & 15u];
}

}  // namespace

bool is_utf8(std::string_view text) {
  while (!text.empty()) {
    const std::size_t bytes = character_bytes(text);
    if (bytes == 0) return false;
    text.remove_prefix(bytes);
  }
  return true;
}

std::string beginning_of(std::string_view text, std::size_t most_bytes) {
  if (text.size() <= most_bytes) return std::string(text);
  constexpr std::size_t kMostBytesOfACharacter = 4;
  for (std::size_t i = 1; i < kMostBytesOfACharacter && i <= most_bytes; ++i) {
    const std::size_t start = most_bytes - i;
    if (character_bytes(text.substr(start)) > i) return std::string(text.substr(0, start));
  }
  return std::string(text.substr(0, most_bytes));
}

std::string toml_text(std::string_view text) {
  std::string result = "\"";
  while (!text.empty()) {
    const std::size_t bytes = character_bytes(text);
    if (bytes == 0)
      result += "\\uFFFD";
    else if (bytes == 1)
      result += escaped(text.front());
    else
      result += text.substr(0, bytes);
    text.remove_prefix(bytes == 0 ? 1 : bytes);
  }
  return result + "\"";
}

}  // namespace af
