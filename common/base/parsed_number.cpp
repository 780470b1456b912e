// SPDX-License-Identifier: Apache-2.0
#include "base/parsed_number.h"

#include <charconv>
#include <cmath>

namespace af {

std::optional<double> parsed_number(std::string_view text) {
  // from_chars() takes "-" but no "+".
  if (text.starts_with('+') && !text.starts_with("+-")) text.remove_prefix(1);
  double value = 0.0;
  const char* const end = text.data() + text.size();
  const auto [rest, error] = std::from_chars(text.data(), end, value);
  if (error != std::errc() || rest != end) return std::nullopt;
  return value;
}

std::optional<double> finite_number(std::string_view text) {
  const std::optional<double> value = parsed_number(text);
  return value && std::isfinite(*value) ? value : std::nullopt;
}

}  // namespace af
