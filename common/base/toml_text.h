// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

namespace af {

bool is_utf8(std::string_view text);

/// A TOML basic string that reads back as `text`. Bytes that are not UTF-8, which no TOML file can
/// hold, become U+FFFD.
std::string toml_text(std::string_view text);

}  // namespace af
