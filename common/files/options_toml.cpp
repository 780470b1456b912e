// SPDX-License-Identifier: Apache-2.0
#include "files/options_toml.h"

#include <charconv>
#include <cmath>
#include <sstream>

#include "base/toml_text.h"

namespace af {

namespace {

/// TOML of a value; empty for one that was not given.
struct TomlOfValue {
  template <typename T>
  std::string operator()(const T* value) const {
    return text(*value);
  }
  template <typename T>
  [[nodiscard]] std::string text(const T& value) const {
    return element(value);
  }
  [[nodiscard]] std::string text(const std::string& value) const {
    return value.empty() ? "" : element(value);
  }
  [[nodiscard]] std::string text(const std::filesystem::path& value) const {
    return value.empty() ? "" : element(value);
  }
  template <typename T>
  [[nodiscard]] std::string text(const std::optional<T>& value) const {
    return value.has_value() ? text(*value) : "";
  }
  template <typename T>
  [[nodiscard]] std::string text(const std::vector<T>& values) const {
    return values.empty() ? "" : list(values);
  }
  template <typename T, std::size_t Size>
  [[nodiscard]] std::string text(const std::array<T, Size>& values) const {
    return list(values);
  }

 private:
  [[nodiscard]] static std::string element(bool value) { return value ? "true" : "false"; }
  [[nodiscard]] static std::string element(int value) { return std::to_string(value); }
  [[nodiscard]] static std::string element(std::int64_t value) { return std::to_string(value); }
  [[nodiscard]] static std::string element(std::uint64_t value) { return std::to_string(value); }
  [[nodiscard]] static std::string element(double value) { return toml_float(value); }
  [[nodiscard]] static std::string element(const std::string& value) { return toml_text(value); }
  [[nodiscard]] static std::string element(const std::filesystem::path& value) {
    return toml_text(value.string());
  }

  /// Lists are written on one line where that is short.
  template <typename List>
  [[nodiscard]] static std::string list(const List& values) {
    constexpr std::size_t kLongestLine = 100;
    std::string line;
    std::string lines;
    for (const auto& value : values) {
      const std::string part = element(value);
      line += (line.empty() ? "" : ", ") + part;
      lines += "\n  " + part + ",";
    }
    return line.size() <= kLongestLine ? "[" + line + "]" : "[" + lines + "\n]";
  }
};

/// Name and TOML of what is recorded for a field.
std::pair<std::string, std::string> recorded(const Field& field) {
  std::string text = std::visit(TomlOfValue{}, field.value);
  if (text.empty() && !field.name_when_unset.empty())
    return {field.name_when_unset, field.text_when_unset};
  return {field.name, std::move(text)};
}

}  // namespace

std::string toml_float(double value) {
  if (std::isnan(value)) return "nan";
  if (std::isinf(value)) return value > 0.0 ? "inf" : "-inf";
  constexpr double kSmallestPlain = 1e-5;
  constexpr double kLargestPlain = 1e15;
  const double size = std::abs(value);
  const bool is_plain = size == 0.0 || (size >= kSmallestPlain && size < kLargestPlain);
  std::array<char, 32> text{};
  const auto end =
      std::to_chars(text.data(),
                    text.data() + text.size(),
                    value,
                    is_plain ? std::chars_format::fixed : std::chars_format::scientific)
          .ptr;
  std::string digits(text.data(), end);
  // TOML tells floats from integers by the point or exponent.
  if (digits.find_first_of(".e") == std::string::npos) digits += ".0";
  return digits;
}

std::string toml_of_fields(const Fields& fields) {
  std::string toml;
  for (const Field& field : fields) {
    if (!field.is_recorded) continue;
    const auto [name, text] = recorded(field);
    if (!text.empty()) toml.append(name).append(" = ").append(text) += '\n';
  }
  return toml;
}

OptionTexts deciding_fields(const Fields& fields, const std::string& stage) {
  OptionTexts texts;
  for (const Field& field : fields) {
    if (!field.is_deciding || (!stage.empty() && field.stage != stage)) continue;
    auto [name, text] = recorded(field);
    if (!text.empty()) texts[name] = std::move(text);
  }
  return texts;
}

OptionTexts option_texts(const std::string& toml) {
  OptionTexts texts;
  std::string* last = nullptr;
  std::istringstream lines(toml);
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with('#')) continue;
    const std::size_t equals = line.find(" = ");
    const bool begins = equals != std::string::npos && line.front() != ' ';
    if (begins)
      last = &(texts[line.substr(0, equals)] = line.substr(equals + 3));
    else if (last != nullptr)
      *last += line;
  }
  return texts;
}

}  // namespace af
