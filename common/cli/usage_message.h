// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "cli/app_forward.h"

namespace CLI {
class ParseError;
}

namespace af::cli {

/// What is wrong with a command line that CLI11 refused. An argument that nobody knows comes before
/// whatever follows from it (a typing error of a required option makes CLI11 say that the option is
/// missing), with the name that was probably meant; a value that does not fit comes with the form
/// that --help shows.
std::string usage_message(const CLI::App& app, const CLI::ParseError& error);

}  // namespace af::cli
