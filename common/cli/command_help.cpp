// SPDX-License-Identifier: Apache-2.0
#include "cli/command_help.h"

#include <algorithm>
#include <set>
#include <type_traits>

#include <CLI/CLI.hpp>

#include "cli/bind_options.h"

namespace af::cli {

namespace {

/// What one value of a field is, and how many values it has.
struct ValueVisitor {
  OptionHelp& help;

  template <typename T>
  void operator()(const T* /*value*/) const {
    visit(static_cast<T*>(nullptr));
  }
  void visit(const bool* /*type*/) const {}
  void visit(const std::string* /*type*/) const {}
  void visit(const std::filesystem::path* /*type*/) const {
    help.value_word = "PATH";
    help.kind = OptionHelp::Kind::Path;
  }
  void visit(const double* /*type*/) const {
    help.value_word = "FLOAT";
    help.kind = OptionHelp::Kind::Number;
  }
  template <typename T>
  void visit(const T* /*type*/) const {
    static_assert(std::is_integral_v<T>);
    help.kind = OptionHelp::Kind::Integer;
  }
  template <typename T>
  void visit(const std::optional<T>* /*type*/) const {
    visit(static_cast<T*>(nullptr));
  }
  template <typename T>
  void visit(const std::vector<T>* /*type*/) const {
    help.is_list = true;
    visit(static_cast<T*>(nullptr));
  }
  template <typename T, std::size_t Size>
  void visit(const std::array<T, Size>* /*type*/) const {
    help.is_list = true;
    visit(static_cast<T*>(nullptr));
    std::string words = help.value_word;
    for (std::size_t i = 1; i < Size; ++i) words += "," + help.value_word;
    help.value_word = words;
  }
};

/// The type without its choices: CLI11 says "TEXT:{a,b}".
std::string first_word(const std::string& type) {
  return type.substr(0, type.find_first_of(": "));
}

/// The names between the braces of "TEXT:{a,b}".
std::vector<std::string> listed_choices(const std::string& type) {
  std::vector<std::string> choices;
  const std::size_t open = type.find('{');
  const std::size_t close = type.find('}');
  if (open == std::string::npos || close == std::string::npos) return choices;
  for (std::size_t begin = open + 1; begin < close;) {
    const std::size_t end = std::min(type.find(',', begin), close);
    choices.push_back(type.substr(begin, end - begin));
    begin = end + 1;
  }
  return choices;
}

OptionHelp::Kind kind_of(const OptionHelp& help) {
  if (help.value_word.empty()) return OptionHelp::Kind::Flag;
  if (help.value_word == "INT" || help.value_word == "UINT") return OptionHelp::Kind::Integer;
  if (help.value_word == "FLOAT") return OptionHelp::Kind::Number;
  return OptionHelp::Kind::Text;
}

void add_description(const Field& field, OptionHelp& help) {
  for (const Constraint& constraint : field.constraints) {
    help.constraint += (help.constraint.empty() ? "" : " and ") + constraint.words;
    if (constraint.low.has_value()) help.low = constraint.low;
    if (constraint.high.has_value()) help.high = constraint.high;
    if (help.choices.empty()) help.choices = constraint.names;
  }
  if (!field.choices.empty()) help.choices = field.choices;
  if (!help.choices.empty()) help.constraint.clear();
  help.path_role = field.path_role;
  help.file_endings = field.file_endings;
  if (!help.value_word.empty()) std::visit(ValueVisitor{help}, field.value);
  if (field.is_size) {
    help.value_word = "SIZE";
    help.kind = OptionHelp::Kind::Text;
  }
  help.is_repeated = help.is_list && !help.is_comma_separated;
}

OptionHelp option_help(const CLI::App& app, const CLI::Option& option, const std::string& group) {
  static const std::set<std::string> of_every_program = {
      "--help", "--version", "--help-as", "--no-lock", "--xml", "--list"};
  OptionHelp help;
  for (const std::string& name : option.get_snames()) help.names.push_back("-" + name);
  for (const std::string& name : option.get_lnames()) help.names.push_back("--" + name);
  help.is_positional = help.names.empty();
  if (help.is_positional) help.names.push_back(option.get_name(true));
  const bool is_flag = option.get_expected_max() == 0;
  const std::string type = option.get_type_name();
  help.value_word = is_flag ? "" : first_word(type);
  help.kind = kind_of(help);
  help.text = option.get_description();
  help.default_text = option.get_default_str();
  // CLI11 writes lists as "[1,2]".
  std::erase_if(help.default_text, [](char c) { return c == '[' || c == ']'; });
  help.choices = listed_choices(type);
  help.group = group;
  help.is_required = option.get_required();
  help.is_comma_separated = option.get_delimiter() == ',';
  help.is_list = option.get_items_expected_max() > 1;
  help.is_repeated = help.is_list && !help.is_comma_separated;
  help.depends_on_others = !option.get_needs().empty() || !option.get_excludes().empty();
  help.is_of_every_program = of_every_program.contains(help.long_name());
  if (const Field* field = bound_field(app, option)) add_description(*field, help);
  return help;
}

void add_options(const CLI::App& app, const std::string& group, CommandHelp& help) {
  for (const CLI::Option* option : app.get_options()) {
    const std::string& own = option->get_group();
    if (own.empty()) continue;  // hidden
    // CLI11 gives a group of options a --help of its own. The program's is enough.
    if (!group.empty() && option == app.get_help_ptr()) continue;
    help.options.push_back(option_help(app, *option, !group.empty() ? group : own));
  }
}

}  // namespace

const std::string& OptionHelp::long_name() const {
  return *std::max_element(names.begin(), names.end(), [](const auto& a, const auto& b) {
    return a.starts_with("--") < b.starts_with("--");
  });
}

CommandHelp command_help(const CLI::App& app) {
  CommandHelp help{app.get_name(), app.get_description(), {}, {}};
  add_options(app, "", help);
  for (const CLI::App* part : app.get_subcommands([](const CLI::App*) { return true; })) {
    if (part->get_name().empty())  // CLI11's group of options
      add_options(*part, part->get_group() + " (" + part->get_description() + ")", help);
    else
      help.commands.push_back(command_help(*part));
  }
  return help;
}

}  // namespace af::cli
