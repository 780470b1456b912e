// SPDX-License-Identifier: Apache-2.0
#include "cli/option_values.h"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <string>
#include <string_view>

#include <CLI/CLI.hpp>

#include "base/parsed_number.h"

namespace af::cli {

namespace {

template <typename Number>
bool is_whole_number(std::string_view text) {
  if (text.starts_with('+')) text.remove_prefix(1);
  const std::string_view digits = text.substr(text.starts_with('-') ? 1 : 0);
  // CLI11 takes a leading zero for the mark of an octal or hexadecimal number.
  if (digits.size() > 1 && digits.front() == '0') return false;
  Number value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc() && end == text.data() + text.size();
}

/// The number of a size: "8 GB" -> "8".
std::string_view without_unit(std::string_view text) {
  const std::size_t unit = text.find_first_not_of("+-0123456789");
  return text.substr(0, unit);
}

/// What a value must be but is not. Empty when it is sound.
std::string problem_of(const std::string& type, const std::string& value) {
  const auto is_of = [&](const char* name) { return type.find(name) != std::string::npos; };
  if (value.empty()) return "must not be empty";
  if (is_of("FLOAT") && !finite_number(value)) return "must be a finite number";
  const std::string_view number = is_of("SIZE") ? without_unit(value) : std::string_view(value);
  if (is_of("UINT")) {
    if (!is_whole_number<std::uint64_t>(number))
      return "must be a whole number from 0 to 18446744073709551615, in decimal digits";
  } else if (is_of("INT") && !is_whole_number<std::int64_t>(number)) {
    return "must be a whole number in decimal digits";
  }
  return {};
}

/// Bytes of a unit such as "MB" or "kib"; 0 for an unknown one.
double bytes_of_unit(std::string unit) {
  std::transform(unit.begin(), unit.end(), unit.begin(), [](unsigned char letter) {
    return static_cast<char>(std::tolower(letter));
  });
  if (unit.empty() || unit == "b") return 1.0;
  const std::size_t power = std::string_view("kmgtpe").find(unit.front());
  if (power == std::string_view::npos) return 0.0;
  const std::string rest = unit.substr(1);
  if (rest == "i" || rest == "ib") return std::pow(1024.0, static_cast<double>(power) + 1.0);
  return rest.empty() || rest == "b" ? std::pow(1000.0, static_cast<double>(power) + 1.0) : 0.0;
}

void check_values(const CLI::Option& option) {
  if (option.get_expected_max() == 0) return;  // a flag
  for (const std::string& value : option.results())
    if (const std::string problem = problem_of(option.get_type_name(), value); !problem.empty())
      throw CLI::ValidationError(option.get_name(),
                                 std::string("'").append(value).append("' ").append(problem));
}

}  // namespace

std::string whole_bytes(const std::string& size) {
  if (size.find('.') == std::string::npos) return size;
  double number = 0.0;
  const auto [end, error] = std::from_chars(size.data(), size.data() + size.size(), number);
  if (error != std::errc()) return size;
  const char* const last = size.data() + size.size();
  const double bytes =
      number * bytes_of_unit({std::find_if(end, last, [](char c) { return c != ' '; }), last});
  constexpr double kExact = 9007199254740992.0;  // 2^53: doubles hold every whole number below
  if (!(bytes >= 1.0 && bytes <= kExact)) return size;
  // 1.1 MB is 1100000.0000000002 in binary, so rounding allows for the last bits.
  return std::to_string(static_cast<std::uint64_t>(std::floor(bytes * (1.0 + 1e-15))));
}

void check_option_values(const CLI::App& app) {
  for (const CLI::Option* option : app.get_options())
    if (option->count() > 0) check_values(*option);
  for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; }))
    check_option_values(*command);
}

}  // namespace af::cli
