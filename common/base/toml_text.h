// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace af {

bool is_utf8(std::string_view text);

/// At most the first `most_bytes` of a text, without cutting a UTF-8 character in two. For
/// messages.
std::string beginning_of(std::string_view text, std::size_t most_bytes);

/// A TOML basic string that reads back as `text`. Bytes that are not UTF-8, which no TOML file can
/// hold, become U+FFFD.
std::string toml_text(std::string_view text);

}  // namespace af
