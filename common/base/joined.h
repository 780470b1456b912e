// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <string>

namespace af {

/// "a, b, c": the parts, each as `text` makes a string of it.
template <typename Parts, typename Text = std::identity>
std::string joined(const Parts& parts, const std::string& between = ", ", const Text& text = {}) {
  std::string result;
  for (const auto& part : parts)
    result += (result.empty() ? "" : between) + std::string(std::invoke(text, part));
  return result;
}

}  // namespace af
