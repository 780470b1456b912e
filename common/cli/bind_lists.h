// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <string>

#include "cli/app_forward.h"

namespace af::cli {

/// --list NAME prints the list of that name, for scripts, and ends the program. It works without
/// options that are otherwise required.
void bind_lists(CLI::App& app, const std::map<std::string, std::string>& lists);

}  // namespace af::cli
