// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string_view>

namespace af {

/// Parses the whole text as one number: decimal, "inf" or "nan", with at most one sign and no
/// blanks. nullopt for anything else and for numbers that no double can hold. The reverse of
/// number_text().
std::optional<double> parsed_number(std::string_view text);

/// Like parsed_number(), but only for finite numbers.
std::optional<double> finite_number(std::string_view text);

}  // namespace af
