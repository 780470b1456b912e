// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <string>

#include "cli/app_forward.h"

namespace af::cli {

/// --list NAME prints the list of that name, made for scripts, and ends the program; options that
/// are required otherwise need not be given beside it.
void bind_lists(CLI::App& app, const std::map<std::string, std::string>& lists);

}  // namespace af::cli
