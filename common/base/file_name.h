// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>

namespace af {

/// Whether a name from an input (a case, a camera) may become part of file names and a cell of
/// tables. It must not be empty or longer than 100 bytes, hold '/' or control characters, be "." or
/// "..", or begin with =, +, - or @. Such a name cannot lead out of the folder in which a file is
/// written, and no spreadsheet takes it for a formula.
bool is_plain_file_name(std::string_view name);

/// What messages say of this rule.
inline constexpr const char* kPlainFileName =
    ": at most 100 bytes, no '/' or control characters, no '=', '+', '-' or '@' in front (a "
    "spreadsheet would take it for a formula)";

}  // namespace af
