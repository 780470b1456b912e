// SPDX-License-Identifier: Apache-2.0
// A program's options as data, from which every help page and front end is made (help_pages.h,
// shell_completion.h, slicer_module.h).
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "base/described_fields.h"
#include "cli/app_forward.h"

namespace af::cli {

/// One option of a command.
struct OptionHelp {
  enum class Kind { Flag, Integer, Number, Text, Path };

  std::vector<std::string> names;  ///< "-o", "--output"; for a positional argument its name
  bool is_positional = false;
  Kind kind = Kind::Text;
  std::string value_word;    ///< "INT", "TEXT", ... as in --help; empty: a flag
  std::string text;          ///< what it does
  std::string default_text;  ///< empty: none is shown
  std::string constraint;    ///< "at least 1"; empty: none
  std::vector<std::string> choices;
  std::string group;  ///< heading in the help; empty: none
  bool is_required = false;
  bool is_list = false;              ///< takes several values ...
  bool is_comma_separated = false;   ///< ... in one argument, with commas between them
  bool is_repeated = false;          ///< may be given several times
  bool depends_on_others = false;    ///< needs or excludes other options
  bool is_of_every_program = false;  ///< --help and the like
  std::optional<double> low;
  std::optional<double> high;
  PathRole path_role = PathRole::Unsaid;
  std::string file_endings;

  /// The longest name, with its dashes.
  [[nodiscard]] const std::string& long_name() const;
};

/// A program or a sub-command.
struct CommandHelp {
  std::string name;
  std::string text;
  std::vector<OptionHelp> options;
  std::vector<CommandHelp> commands;
};

/// The help of a program that already has its name and all its options.
CommandHelp command_help(const CLI::App& app);

}  // namespace af::cli
