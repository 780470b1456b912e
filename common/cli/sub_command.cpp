// SPDX-License-Identifier: Apache-2.0
#include "cli/sub_command.h"

#include <CLI/CLI.hpp>

namespace af::cli {

CLI::App* add_sub_command(CLI::App& program, const char* name, const char* help) {
  return program.add_subcommand(name, help);
}

}  // namespace af::cli
