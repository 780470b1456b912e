// SPDX-License-Identifier: Apache-2.0
#include "base/described_fields.h"

#include <algorithm>
#include <cmath>

#include "base/number_text.h"

namespace af {

namespace {

template <typename T>
constexpr bool kIsText = std::is_same_v<T, std::string> || std::is_same_v<T, std::filesystem::path>;

template <typename T>
constexpr bool kIsArray = false;
template <typename T, std::size_t Size>
constexpr bool kIsArray<std::array<T, Size>> = true;
template <typename T>
constexpr bool kIsArray<std::optional<T>> = kIsArray<T>;

std::string words_of_list(const std::vector<std::string>& names) {
  std::string text;
  for (std::size_t i = 0; i < names.size(); ++i)
    text += (i == 0 ? "" : i + 1 == names.size() ? " or " : ", ") + names[i];
  return text;
}

/// Passes on one value, or those of a list or an optional one.
struct ElementVisitor {
  const std::function<void(double)>& number;
  const std::function<void(const std::string&)>& text;

  template <typename T>
  void operator()(const T* value) const {
    visit(*value);
  }
  template <typename T>
  void visit(const T& value) const {
    if constexpr (std::is_same_v<T, std::filesystem::path>)
      text(value.string());
    else if constexpr (kIsText<T>)
      text(value);
    else
      number(static_cast<double>(value));
  }
  template <typename T>
  void visit(const std::optional<T>& value) const {
    if (value.has_value()) visit(*value);
  }
  template <typename T>
  void visit(const std::vector<T>& values) const {
    for (const T& value : values) visit(value);
  }
  template <typename T, std::size_t Size>
  void visit(const std::array<T, Size>& values) const {
    for (const T& value : values) visit(value);
  }
};

}  // namespace

Field& Field::at_least(double low) {
  such_that("at least " + number_text(low), [low](double v) { return v >= low; });
  constraints.back().low = low;
  return *this;
}

Field& Field::above(double low) {
  return such_that("above " + number_text(low), [low](double v) { return v > low; });
}

Field& Field::at_most(double high) {
  such_that("at most " + number_text(high), [high](double v) { return v <= high; });
  constraints.back().high = high;
  return *this;
}

Field& Field::within(double low, double high) {
  such_that("between " + number_text(low) + " and " + number_text(high),
            [low, high](double v) { return v >= low && v <= high; });
  constraints.back().low = low;
  constraints.back().high = high;
  return *this;
}

Field& Field::finite() {
  return such_that("finite", [](double v) { return std::isfinite(v); });
}

Field& Field::such_that(std::string words, std::function<bool(double)> accepts) {
  Constraint& constraint = constraints.emplace_back();
  constraint.words = std::move(words);
  constraint.accepts_number = std::move(accepts);
  return *this;
}

Field& Field::one_of(std::vector<std::string> names) {
  of_form(words_of_list(names), [names](const std::string& text) {
    return std::find(names.begin(), names.end(), text) != names.end();
  });
  constraints.back().names = std::move(names);
  return *this;
}

Field& Field::of_form(std::string words, std::function<bool(const std::string&)> accepts) {
  Constraint& constraint = constraints.emplace_back();
  constraint.words = std::move(words);
  constraint.accepts_text = std::move(accepts);
  return *this;
}

Field& Field::as(std::string option_names) {
  option = std::move(option_names);
  return *this;
}

Field& Field::as(std::string option_names, std::string help_text) {
  help = std::move(help_text);
  return as(std::move(option_names));
}

Field& Field::no_option(const char* /*why*/) {
  option.clear();
  return *this;
}

Field& Field::choice(std::vector<std::string> names) {
  choices = std::move(names);
  return *this;
}

Field& Field::one_of_group(std::string name_of_group) {
  exactly_one_of = std::move(name_of_group);
  return *this;
}

Field& Field::excludes(std::vector<std::string> options) {
  excluded = std::move(options);
  return *this;
}

Field& Field::needs(std::vector<std::string> options) {
  needed = std::move(options);
  return *this;
}

Field& Field::count(int numbers) {
  number_count = numbers;
  return *this;
}

Field& Field::required() {
  is_required = true;
  return *this;
}

Field& Field::checked_when_typed() {
  is_checked_when_typed = true;
  return *this;
}

Field& Field::comma_separated() {
  is_comma_separated = true;
  return *this;
}

Field& Field::one_at_a_time() {
  takes_one_at_a_time = true;
  return *this;
}

Field& Field::size() {
  is_size = true;
  return *this;
}

Field& Field::off_switch() {
  is_off_switch = true;
  return *this;
}

Field& Field::default_in_help() {
  shows_default = false;
  return *this;
}

Field& Field::stands_for(PathRole role, std::string endings) {
  path_role = role;
  file_endings = std::move(endings);
  return *this;
}

Field& Field::not_recorded(const char* why) {
  is_recorded = false;
  return not_deciding(why);
}

Field& Field::not_deciding(const char* /*why*/) {
  is_deciding = false;
  return *this;
}

Field& Field::input() {
  is_deciding = false;
  return *this;
}

Field& Field::decides(std::string stage_name) {
  stage = std::move(stage_name);
  return *this;
}

Field& Field::recorded_when_unset(std::string other_name, std::string text) {
  name_when_unset = std::move(other_name);
  text_when_unset = std::move(text);
  return *this;
}

Field& Fields::add(const std::string& name, FieldValue value, const std::string& help) {
  Field& field = fields_.emplace_back();
  field.option = "--" + name;
  std::replace(field.option.begin(), field.option.end(), '_', '-');
  field.name = name;
  field.value = value;
  field.help = help;
  field.group = group_;
  // Points and directions are typed with commas.
  field.is_comma_separated = std::visit(
      [](const auto* of_field) { return kIsArray<std::remove_cvref_t<decltype(*of_field)>>; },
      value);
  return field;
}

void Fields::append(const Fields& part) {
  for (const Field& of_part : part) {
    Field& field = fields_.emplace_back(of_part);
    if (field.group.empty()) field.group = group_;
  }
}

Field& Fields::at(const std::string& name) {
  const auto found = std::find_if(
      fields_.begin(), fields_.end(), [&](const Field& field) { return field.name == name; });
  check(found != fields_.end(), "at() needs the name of a listed field");
  return *found;
}

void Fields::without_options(const char* why) {
  for (Field& field : fields_) field.no_option(why);
}

void Fields::name_like_options() {
  for (Field& field : fields_) std::replace(field.name.begin(), field.name.end(), '_', '-');
}

void for_each_element(const FieldValue& value,
                      const std::function<void(double)>& number,
                      const std::function<void(const std::string&)>& text) {
  std::visit(ElementVisitor{number, text}, value);
}

std::vector<std::string> field_problems(const Fields& fields) {
  std::vector<std::string> found;
  for (const Field& field : fields) {
    std::string words;
    for (const Constraint& constraint : field.constraints)
      words += (words.empty() ? "" : " and ") + constraint.words;
    const auto require = [&](bool is_accepted, const std::string& value) {
      if (!is_accepted)
        found.push_back(std::string(field.name).append(" = ").append(value).append(": must be ") +
                        words);
    };
    const auto all = [&](const auto& accepts) {
      return std::all_of(field.constraints.begin(), field.constraints.end(), accepts);
    };
    for_each_element(
        field.value,
        [&](double number) {
          require(all([&](const Constraint& c) { return c.accepts_number(number); }),
                  number_text(number));
        },
        [&](const std::string& text) {
          require(all([&](const Constraint& c) { return c.accepts_text(text); }),
                  text.empty() ? "''" : text);
        });
  }
  return found;
}

}  // namespace af
