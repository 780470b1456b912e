// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "evaluate/scan/scan_options.h"
#include "ranks/communicator.h"

namespace af::tools {

/// Calibrates a circular scan by its even views, judges that by the odd ones, reconstructs a CT and
/// writes the study. The root does all of it, with threads, and prints what was found. Throws
/// InputError for impossible options, FileError for files that are missing or damaged.
void run_scan(const ScanOptions& options,
              const std::string& command_line,
              const Communicator& world);

}  // namespace af::tools
