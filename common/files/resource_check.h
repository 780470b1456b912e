// SPDX-License-Identifier: Apache-2.0
// Checks before the work whether disk and memory suffice.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

namespace af {

/// Throws InputError when a new file of `bytes` at `path` does not fit on its file system now.
void require_disk_space(const std::filesystem::path& path, double bytes);

/// Throws InputError, naming `what` asks for it, when this machine does not have `bytes` of memory
/// left.
void require_memory(const std::string& what, double bytes);

}  // namespace af
