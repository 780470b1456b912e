// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string_view>

namespace af {

/// The number that a text is, all of it: decimal, "inf" or "nan", with one sign at most and no
/// blanks. None for anything else, and for what no double can hold. The reverse of number_text().
std::optional<double> parsed_number(std::string_view text);

/// As parsed_number(), of finite numbers alone.
std::optional<double> finite_number(std::string_view text);

}  // namespace af
