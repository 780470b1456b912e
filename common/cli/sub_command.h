// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "cli/bind_options.h"
#include "ranks/communicator.h"

namespace af::cli {

/// A sub-command of a program, with its options bound.
struct SubCommand {
  CLI::App* app;
  /// Collective.
  std::function<void(const std::string& command_line, const Communicator& world)> run;
};

/// Adds a sub-command without options.
CLI::App* add_sub_command(CLI::App& program, const char* name, const char* help);

/// Adds a sub-command that runs `run` with the options as typed. `options` holds the defaults.
template <Described Options>
SubCommand sub_command(CLI::App& program,
                       const char* name,
                       const char* help,
                       void (*run)(const Options&, const std::string&, const Communicator&),
                       std::shared_ptr<Options> options = std::make_shared<Options>()) {
  CLI::App* const app = add_sub_command(program, name, help);
  bind_options(*app, *options);
  return {app, [options, run](const std::string& command_line, const Communicator& world) {
            run(*options, command_line, world);
          }};
}

}  // namespace af::cli
