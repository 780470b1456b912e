// SPDX-License-Identifier: Apache-2.0
// Checks that every reader makes before we or a library open a file.
#pragma once

#include <filesystem>
#include <fstream>

namespace af {

/// Throws FileError unless `path` leads to a regular file, through links or not. Opening a pipe
/// waits for somebody to write into it, a device may never end, and a folder is read as if it were
/// empty.
void require_regular_file(const std::filesystem::path& path);

/// Opens a regular file for reading its bytes. Throws FileError when it is none or cannot be
/// opened.
std::ifstream open_input_file(const std::filesystem::path& path);

}  // namespace af
