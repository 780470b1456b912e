// SPDX-License-Identifier: Apache-2.0
#include "cli/usage_message.h"

#include <algorithm>
#include <set>
#include <vector>

#include <CLI/CLI.hpp>

#include "base/error.h"
#include "cli/command_help.h"
#include "files/nearest_name.h"

namespace af::cli {

namespace {

/// The sub-command that was named, or the program.
const CLI::App& active_command(const CLI::App& app) {
  const std::vector<CLI::App*> named = app.get_subcommands();
  const auto found =
      std::ranges::find_if(named, [](const CLI::App* part) { return !part->get_name().empty(); });
  return found == named.end() ? app : active_command(**found);
}

/// An option that begins as `typed` does is more likely meant than one that is spelt alike.
std::string meant_name(const std::string& typed, const std::set<std::string>& known) {
  const auto longer = known.lower_bound(typed);
  if (longer != known.end() && longer->starts_with(typed)) return *longer;
  return nearest_name(typed, known);
}

std::string unknown_option(const CommandHelp& command, const std::string& argument) {
  const std::string typed = argument.substr(0, argument.find('='));
  std::set<std::string> names;
  for (const OptionHelp& option : command.options)
    if (!option.is_positional) names.insert(option.long_name());
  const std::string meant = meant_name(typed, names);
  return "unknown option '" + typed + "'" +
         (meant.empty() ? std::string() : ": did you mean '" + meant + "'?");
}

std::string unknown_command(const CommandHelp& command, const std::string& argument) {
  std::set<std::string> names;
  std::string list;
  for (const CommandHelp& part : command.commands) {
    names.insert(part.name);
    list += (list.empty() ? "" : ", ") + part.name;
  }
  const std::string meant = meant_name(argument, names);
  return "unknown sub-command '" + argument + "'" +
         (meant.empty() ? ": choose one of " + list : ": did you mean '" + meant + "'?");
}

/// What the option takes whose value cannot be converted, or which has too many or too few values.
std::string form_of_named_option(const CommandHelp& command, const std::string& message) {
  for (const OptionHelp& option : command.options) {
    const std::string& name = option.long_name();
    const std::size_t at = message.find(name);
    if (at == std::string::npos || option.value_word.empty()) continue;
    const std::size_t end = at + name.size();
    if (end < message.size() && message[end] != ' ' && message[end] != ':') continue;
    return name + " takes " + option.value_word;
  }
  return {};
}

}  // namespace

std::string usage_message(const CLI::App& app, const CLI::ParseError& error) {
  const CLI::App& active = active_command(app);
  const CommandHelp command = command_help(active);
  const std::vector<std::string> unknown = app.remaining(true);
  // Without its sub-command, its options are unknown too.
  if (!command.commands.empty() && !unknown.empty() && !unknown.front().starts_with('-'))
    return shortened(unknown_command(command, unknown.front()));
  const auto option = std::ranges::find_if(
      unknown, [](const std::string& argument) { return argument.starts_with('-'); });
  if (option != unknown.end()) return shortened(unknown_option(command, *option));
  const std::string message = error.what();
  constexpr std::string_view kCannotConvert = "Could not convert: ";
  const bool is_conversion = message.starts_with(kCannotConvert);
  if (is_conversion || error.get_name() == "ArgumentMismatch") {
    const std::string form = form_of_named_option(command, message);
    if (form.empty()) return shortened(message);
    if (!is_conversion) return shortened(form + " (" + message + ")");
    return shortened(form + ", not '" + message.substr(message.find(" = ") + 3) + "'");
  }
  if (!unknown.empty())
    return shortened("'" + unknown.front() +
                     "' was not expected: no option before it takes this value");
  return shortened(message);
}

}  // namespace af::cli
