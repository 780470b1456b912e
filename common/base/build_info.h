// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>

namespace af {

/// Project version, for example "0.1.0"; written into every output.
std::string_view program_version();

/// Compiler and version, for example "GNU 12.2.0"; written into benchmark results.
std::string_view compiler_description();

}  // namespace af
