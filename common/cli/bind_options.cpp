// SPDX-License-Identifier: Apache-2.0
#include "cli/bind_options.h"

#include <cstdlib>
#include <map>
#include <memory>
#include <sstream>
#include <type_traits>

#include <CLI/CLI.hpp>

#include "cli/option_values.h"

namespace af::cli {

namespace {

/// Whether --help shows the value as the default.
template <typename T>
bool is_given(const T& value) {
  if constexpr (requires { value.has_value(); })
    return value.has_value();
  else if constexpr (requires { value.empty(); })
    return !value.empty();
  else
    return true;
}

/// What CLI11 keeps for us: the fields of a program's options, by command and name of the option.
struct BoundFields : CLI::Formatter {
  std::map<std::string, Field> of_options;
};

template <typename App>
App& program_of(App& app) {
  App* program = &app;
  while (program->get_parent() != nullptr) program = program->get_parent();
  return *program;
}

/// The program gets its name only when it runs, and a group of options has none.
std::string key_of(const CLI::App& app, const CLI::Option& option) {
  std::string key = option.get_name(true, true);
  for (const CLI::App* command = &app; command->get_parent() != nullptr;
       command = command->get_parent())
    key = command->get_name() + " " + key;
  return key;
}

std::shared_ptr<BoundFields> bound_fields(const CLI::App& app) {
  return std::dynamic_pointer_cast<BoundFields>(program_of(app).get_formatter());
}

template <typename T>
CLI::Option* add_option(CLI::App& app, const Field& field, T& value) {
  CLI::Option* option = app.add_option(field.option, value, field.help);
  if (!field.shows_default || !is_given(value)) return option;
  if constexpr (requires { std::ostringstream() << *value; }) {
    std::ostringstream text;
    text << *value;
    return option->default_str(text.str());
  } else {
    return option->capture_default_str();
  }
}

CLI::Option* add_option(CLI::App& app, const Field& field, bool& value) {
  if (!field.is_off_switch) return app.add_flag(field.option, value, field.help);
  return app.add_flag_callback(
      field.option, [&value] { value = false; }, field.help);
}

/// Refuses numbers that break a constraint of the field.
CLI::Validator check_of(const Field& field) {
  return {[constraints = field.constraints](const std::string& text) {
            char* end = nullptr;
            const double value = std::strtod(text.c_str(), &end);
            for (const Constraint& constraint : constraints)
              if (*end != '\0' || !constraint.accepts_number(value))
                return text + " is not " + constraint.words;
            return std::string();
          },
          ""};
}

/// The group of which exactly one option must be given.
CLI::App& group_of(CLI::App& app, const std::string& name) {
  for (CLI::App* group : app.get_subcommands([](CLI::App*) { return true; }))
    if (group->get_group() == name || group->get_name() == name) return *group;
  CLI::App* group = app.add_option_group(name, "exactly one of");
  group->require_option(1);
  return *group;
}

void bind_field(CLI::App& app, const Field& field) {
  CLI::App& owner = field.exactly_one_of.empty() ? app : group_of(app, field.exactly_one_of);
  CLI::Option* option =
      std::visit([&](auto* value) { return add_option(owner, field, *value); }, field.value);
  if (!field.group.empty()) option->group(field.group);
  if (!field.choices.empty()) option->check(CLI::IsMember(field.choices));
  if (field.is_checked_when_typed) option->check(check_of(field));
  if (field.number_count > 0) option->expected(field.number_count);
  // Extra arguments are off because CLI11 would add the words after a complete list to it.
  if (field.is_comma_separated) option->delimiter(',')->allow_extra_args(false);
  if (field.takes_one_at_a_time) option->allow_extra_args(false);
  if (field.is_size) {
    option->transform(CLI::AsSizeValue(true));
    // CLI11 applies the transform that was added last first.
    option->transform(CLI::Validator(
        [](std::string& text) {
          text = whole_bytes(text);
          return std::string();
        },
        "",
        "decimal size"));
  }
  option->required(field.is_required);
  bound_fields(app)->of_options.insert_or_assign(key_of(owner, *option), field);
}

}  // namespace

void bind_fields(CLI::App& app, const Fields& fields) {
  if (bound_fields(app) == nullptr) program_of(app).formatter(std::make_shared<BoundFields>());
  for (const Field& field : fields)
    if (!field.option.empty()) bind_field(app, field);
  for (const Field& field : fields) {
    if (field.option.empty()) continue;
    // Any one name of "-o,--output" finds the option.
    CLI::Option* const option =
        app.get_option(field.option.substr(field.option.find_last_of(',') + 1));
    for (const std::string& other : field.excluded) option->excludes(app.get_option(other));
    for (const std::string& other : field.needed) option->needs(app.get_option(other));
  }
}

const Field* bound_field(const CLI::App& app, const CLI::Option& option) {
  const auto fields = bound_fields(app);
  if (fields == nullptr) return nullptr;
  const auto found = fields->of_options.find(key_of(app, option));
  return found == fields->of_options.end() ? nullptr : &found->second;
}

}  // namespace af::cli
