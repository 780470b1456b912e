// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "cli/command_help.h"

namespace af::cli {

/// A page of the reference: headings, and a table of options per group. A row that several commands
/// share is in the table of the first, and the others name its option.
std::string markdown_page(const CommandHelp& program);

/// A page for man(1), section 1, with `version` in its footer.
std::string man_page(const CommandHelp& program, const std::string& version);

}  // namespace af::cli
