// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>

namespace af {

/// Whether a name from an input (a case, a camera) may become a part of file names: not empty, at
/// most 100 bytes, without '/' and control characters, neither "." nor "..". Then no file is
/// written outside of the folder it is meant for.
bool is_plain_file_name(std::string_view name);

}  // namespace af
