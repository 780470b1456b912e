// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "cli/app_forward.h"

namespace CLI {
class ParseError;
}

namespace af::cli {

/// Explains why CLI11 refused a command line. An unknown argument is reported first, with the name
/// that was probably meant, because other errors may follow from it: after a typo in a required
/// option, CLI11 says that the option is missing. A bad value is reported with the form that --help
/// shows.
std::string usage_message(const CLI::App& app, const CLI::ParseError& error);

}  // namespace af::cli
