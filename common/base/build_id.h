// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace af {

/// The linker's hash of the program or library that holds this code, in hexadecimal digits. It
/// changes with any of it. "" where it was linked without --build-id.
std::string build_id();

}  // namespace af
