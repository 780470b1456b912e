// SPDX-License-Identifier: Apache-2.0
#include "base/number_text.h"

#include <charconv>
#include <cmath>

#include "base/error.h"

namespace af {

std::string number_text(double value) {
  if (std::isnan(value)) return "nan";
  if (std::isinf(value)) return value > 0.0 ? "inf" : "-inf";
  std::string text(32, '\0');
  const auto [end, error] = std::to_chars(text.data(), text.data() + text.size(), value);
  check(error == std::errc(), "number_text: buffer too small");
  text.resize(static_cast<std::size_t>(end - text.data()));
  return text;
}

}  // namespace af
