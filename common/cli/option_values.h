// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "cli/app_forward.h"

namespace af::cli {

/// Checks every value given to a parsed command and its subcommands against the type of its option.
/// This is stricter than CLI11, which reads -5 as 2^64 - 5 for an unsigned number, 010 as 8 and
/// 99999999999999999999 as the largest number, and accepts nan and inf. Texts must not be empty.
/// Throws CLI::ValidationError, which names the option, for the first bad value.
void check_option_values(const CLI::App& app);

/// "3.5MB" -> "3500000", rounded down to whole bytes. A size without a decimal point stays as it
/// is. So does one with an unknown unit, so that CLI::AsSizeValue(true) names it. kB, MB, ... are
/// powers of 1000, KiB, ... of 1024.
std::string whole_bytes(const std::string& size);

}  // namespace af::cli
