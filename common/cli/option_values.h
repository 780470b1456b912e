// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "cli/app_forward.h"

namespace af::cli {

/// Checks every value given to a parsed command and its subcommands by the type of its option, more
/// strictly than CLI11 converts it: that takes -5 for 2^64 - 5 where a number has no sign, 010 for
/// 8, 99999999999999999999 for the largest number, and nan and inf for numbers. Texts must not be
/// empty. CLI::ValidationError, which names the option, for the first that is not sound.
void check_option_values(const CLI::App& app);

/// "3.5MB" -> "3500000", rounded down to whole bytes; a size without a decimal point stays as it
/// is, and so does one whose unit is not known, so that CLI::AsSizeValue(true) names it. kB, MB,
/// ... are powers of 1000, KiB, ... of 1024.
std::string whole_bytes(const std::string& size);

}  // namespace af::cli
