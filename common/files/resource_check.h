// SPDX-License-Identifier: Apache-2.0
// Checks before the work whether disk and memory suffice for it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

namespace af {

/// InputError when a new file of `bytes` at `path` does not fit on its file system now.
void require_disk_space(const std::filesystem::path& path, double bytes);

/// InputError, naming `what` asks for it, when this machine does not have `bytes` of memory left.
void require_memory(const std::string& what, double bytes);

}  // namespace af
