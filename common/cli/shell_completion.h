// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "cli/command_help.h"

namespace af::cli {

/// A script for bash. It completes sub-commands, options and the names that options choose from,
/// and files elsewhere. It needs no other script.
std::string bash_completion(const CommandHelp& program);

/// The same as a function of zsh's completion system.
std::string zsh_completion(const CommandHelp& program);

}  // namespace af::cli
