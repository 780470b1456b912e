// SPDX-License-Identifier: Apache-2.0
#include "base/file_name.h"

#include <algorithm>

namespace af {

bool is_plain_file_name(std::string_view name) {
  // File systems allow 255 bytes, and a file's name may hold a case's name, a camera's name and a
  // suffix.
  constexpr std::size_t kMaxBytes = 100;
  constexpr unsigned char kDelete = 0x7F;
  const auto is_bad = [](char character) {
    const auto code = static_cast<unsigned char>(character);
    return code < ' ' || code == kDelete || character == '/';
  };
  return !name.empty() && name.size() <= kMaxBytes && name != "." && name != ".." &&
         std::none_of(name.begin(), name.end(), is_bad) &&
         std::string_view("=+-@").find(name.front()) == std::string_view::npos;
}

}  // namespace af
