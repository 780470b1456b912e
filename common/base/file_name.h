// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>

namespace af {

/// Whether a name from an input (a case, a camera) may become a part of file names: not empty, at
/// most 100 bytes, without '/' and control characters, neither "." nor "..". Such a name cannot
/// lead out of the folder in which a file is written.
bool is_plain_file_name(std::string_view name);

}  // namespace af
