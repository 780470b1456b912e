// SPDX-License-Identifier: Apache-2.0
// 3D Slicer asks a program for its options with --xml, and makes a module of the answer
// (docs/slicer.md).
#pragma once

#include <string>

#include "cli/app_forward.h"
#include "cli/command_help.h"

namespace af::cli {

/// The XML of Slicer's execution model. Slicer's parser takes only letters, digits and underscores
/// in names of options. They are therefore written with underscores, which app_main() understands.
/// \test SlicerModule, and tests/programs/slicer_xml.py, which runs the programs with it
std::string slicer_xml(const CommandHelp& program,
                       const std::string& title,
                       const std::string& version);

/// Adds --xml, which prints it and ends the program. Call it after all other options are added.
void bind_slicer_module(CLI::App& app, const std::string& title);

/// Turns a typed option with underscores, such as --start_pose, into --start-pose when the program
/// or one of its commands has that option. Returns any other argument unchanged.
std::string with_dashes(const CLI::App& app, const std::string& argument);

}  // namespace af::cli
