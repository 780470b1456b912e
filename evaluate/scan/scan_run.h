// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "evaluate/scan/scan_options.h"
#include "ranks/communicator.h"

namespace af::tools {

/// Calibrates a circular scan by its even views, judges that by the odd ones, reconstructs a CT and
/// writes the study; its root does all of it, by threads, and prints what was found.
/// InputError for options that cannot be, FileError for files that are missing or damaged.
void run_scan(const ScanOptions& options,
              const std::string& command_line,
              const Communicator& world);

}  // namespace af::tools
