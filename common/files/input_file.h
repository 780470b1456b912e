// SPDX-License-Identifier: Apache-2.0
// What every reader passes before a file is opened, by us or by a library.
#pragma once

#include <filesystem>
#include <fstream>

namespace af {

/// FileError unless `path` leads to a regular file, by links or not: opening a pipe waits for
/// somebody to write into it, a device may never end, a folder is read as if it were empty.
void require_regular_file(const std::filesystem::path& path);

/// Opens a regular file for reading its bytes. FileError when it is none or cannot be opened.
std::ifstream open_input_file(const std::filesystem::path& path);

}  // namespace af
