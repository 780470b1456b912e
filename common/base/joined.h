// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <string>

namespace af {

/// "a, b, c": the parts, each as `text` makes a string of it.
template <typename Parts, typename Text = std::identity>
std::string joined(const Parts& parts, const std::string& between = ", ", const Text& text = {}) {
  std::string result;
  bool is_first = true;
  for (const auto& part : parts) {
    if (!is_first) result += between;
    result += std::string(std::invoke(text, part));
    is_first = false;
  }
  return result;
}

}  // namespace af
