// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace af {

/// A word, quoted for a shell where it needs quotes.
std::string shell_quoted(const std::string& word);

}  // namespace af
