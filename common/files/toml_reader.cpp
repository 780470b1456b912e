// SPDX-License-Identifier: Apache-2.0
#include "files/toml_reader.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>

#include "base/error.h"
#include "base/toml_text.h"
#include "files/csv_table.h"
#include "files/nearest_name.h"
#include "files/output_file.h"

namespace af {

namespace {

constexpr std::size_t kLongestKey = 64;  // in messages

/// toml++ limits the nesting of values, but not of dotted keys, and walks tables recursively.
void check_key_depth(std::string_view text, const std::string& file) {
  constexpr int kMaxDots = 256;
  constexpr std::string_view kEndsKey = ",[]{}=\n#";
  int dots = 0;
  std::size_t line = 1;
  for (const char character : text) {
    if (kEndsKey.find(character) != std::string_view::npos) dots = 0;
    if (character == '\n') ++line;
    if (character == '.' && ++dots > kMaxDots)
      throw FileError(file + ":" + std::to_string(line), "a key is nested too deeply");
  }
}

std::string line_and_column(const toml::source_position& position) {
  return std::to_string(position.line) + ":" + std::to_string(position.column);
}

/// Appends a value as TOML on one line. Stops at the length at which messages are cut.
void append_value(std::string& text, const toml::node& node) {
  constexpr std::size_t kLongEnough = 200;
  if (text.size() > kLongEnough) return;
  if (const toml::array* list = node.as_array()) {
    text += '[';
    for (std::size_t i = 0; i < list->size() && text.size() <= kLongEnough; ++i) {
      if (i > 0) text += ", ";
      append_value(text, *list->get(i));
    }
    text += ']';
  } else if (const auto* string = node.as_string()) {
    text += toml_text(string->get().substr(0, kLongEnough));
  } else if (const auto* number = node.as_floating_point()) {
    text += number_text(number->get());
  } else if (node.is_table()) {
    text += "{...}";
  } else {
    std::ostringstream out;
    node.visit([&out](const auto& value) { out << value; });
    text += out.str();
  }
}

/// A value on one line, shortened for messages.
std::string value_text(const toml::node& node) {
  constexpr std::size_t kMaxLength = 100;
  std::string text;
  append_value(text, node);
  if (text.size() <= kMaxLength) return text;
  std::size_t end = kMaxLength - 4;
  while (end > 0 && (static_cast<unsigned char>(text[end]) & 0xC0) == 0x80) --end;  // inside UTF-8
  return text.substr(0, end) + " ...";
}

std::optional<double> number_within(const toml::node& node, double most) {
  if (!node.is_number()) return std::nullopt;
  const auto value = node.value<double>();
  if (!value || !(std::abs(*value) <= most)) return std::nullopt;
  return value;
}

/// The numbers of a list of `count` numbers within `most`; nullopt for anything else.
std::optional<std::vector<double>> numbers_within(const toml::node& node, int count, double most) {
  const toml::array* list = node.as_array();
  if (list == nullptr || list->size() != static_cast<std::size_t>(count)) return std::nullopt;
  std::vector<double> numbers;
  for (const toml::node& element : *list) {
    const auto number = number_within(element, most);
    if (!number) return std::nullopt;
    numbers.push_back(*number);
  }
  return numbers;
}

/// Whether a row is [], or as many NaNs as there are columns.
bool is_absent_row(const toml::node& node, int columns) {
  const toml::array* list = node.as_array();
  if (list == nullptr) return false;
  if (!list->empty() && list->size() != static_cast<std::size_t>(columns)) return false;
  return std::all_of(list->begin(), list->end(), [](const toml::node& element) {
    const auto number = element.value_exact<double>();
    return number.has_value() && std::isnan(*number);
  });
}

std::string wanted_numbers(double most) {
  return " finite numbers, each within +-" + number_text(most);
}

}  // namespace

toml::table parse_toml(std::string_view text, const std::string& file) {
  if (text.find_first_not_of(" \t\r\n") == std::string_view::npos)
    throw FileError(file, "is empty; TOML was expected");
  check_key_depth(text, file);
  try {
    return toml::parse(text, file);
  } catch (const toml::parse_error& error) {
    throw FileError(file + ":" + line_and_column(error.source().begin),
                    "is not valid TOML: " + std::string(error.description()));
  }
}

toml::table read_toml_file(const std::filesystem::path& path) {
  return parse_toml(read_text_file(path, kMostTomlBytes), path.string());
}

void TomlProblems::add(const toml::node& node, const std::string& message) {
  problems_.push_back({node.source().begin.line, where(node) + ": " + message});
}

std::string TomlProblems::where(const toml::node& node) const {
  const auto line = node.source().begin.line;
  return line > 0 ? file_ + ":" + std::to_string(line) : file_;
}

void TomlProblems::throw_if_any() const {
  std::vector<Problem> sorted = problems_;
  std::stable_sort(sorted.begin(), sorted.end(), [](const Problem& a, const Problem& b) {
    return a.line < b.line;
  });
  std::vector<std::string> messages;
  messages.reserve(sorted.size());
  for (Problem& problem : sorted) messages.push_back(std::move(problem.message));
  af::throw_if_any(messages);
}

const toml::node& TomlTableReader::node(const char* key) const {
  const toml::node* found = table_.get(key);
  return found != nullptr ? *found : table_;
}

bool TomlTableReader::has(const char* key) {
  known_keys_.insert(key);
  return table_.contains(key);
}

bool TomlTableReader::has_number(const char* key) {
  return has(key) && node(key).is_number();
}

std::string TomlTableReader::place(const char* key) const {
  return problems_.where(node(key)) + ": " + prefix_ + key;
}

void TomlTableReader::add_problem(const char* key, const std::string& constraint) {
  const toml::node* found = table_.get(key);
  const std::string value = found != nullptr ? " = " + value_text(*found) : std::string();
  problems_.add(node(key), prefix_ + key + value + ": " + constraint);
}

const toml::node* TomlTableReader::find(const char* key, Presence presence) {
  known_keys_.insert(key);
  const toml::node* found = table_.get(key);
  if (found == nullptr && presence == Presence::Required)
    problems_.add(table_, prefix_ + key + " is missing");
  return found;
}

std::optional<std::string> TomlTableReader::get_string(const char* key, Presence presence) {
  const toml::node* found = find(key, presence);
  if (found == nullptr) return std::nullopt;
  if (auto text = found->value_exact<std::string>(); text && !text->empty()) {
    if (text->find('\0') == std::string::npos) return text;
    add_problem(key, "must not contain a NUL character");
    return std::nullopt;
  }
  add_problem(key, "must be text in quotes, and not empty");
  return std::nullopt;
}

std::optional<double> TomlTableReader::get_number(const char* key, Presence presence) {
  const toml::node* found = find(key, presence);
  if (found == nullptr) return std::nullopt;
  const auto number = number_within(*found, std::numeric_limits<double>::max());
  if (!number) add_problem(key, "must be a finite number");
  return number;
}

std::optional<int> TomlTableReader::get_integer(const char* key, Presence presence) {
  const toml::node* found = find(key, presence);
  if (found == nullptr) return std::nullopt;
  const auto number = number_within(*found, std::numeric_limits<int>::max());
  if (number && *number == std::round(*number)) return static_cast<int>(*number);
  add_problem(key, "must be a whole number");
  return std::nullopt;
}

std::optional<std::vector<double>> TomlTableReader::get_numbers(const char* key,
                                                                int count,
                                                                Presence presence) {
  const toml::node* found = find(key, presence);
  if (found == nullptr) return std::nullopt;
  auto numbers = numbers_within(*found, count, kMaxRoomMm);
  if (!numbers)
    add_problem(key, "must be a list of " + std::to_string(count) + wanted_numbers(kMaxRoomMm));
  return numbers;
}

std::optional<std::vector<double>> TomlTableReader::get_number_list(const char* key,
                                                                    Presence presence) {
  const toml::node* found = find(key, presence);
  if (found == nullptr) return std::nullopt;
  const toml::array* list = found->as_array();
  const int count = list == nullptr ? 0 : static_cast<int>(list->size());
  auto numbers = count > 0 ? numbers_within(*found, count, kMaxRoomMm) : std::nullopt;
  if (!numbers) add_problem(key, "must be a list of" + wanted_numbers(kMaxRoomMm));
  return numbers;
}

std::optional<std::vector<int>> TomlTableReader::get_integers(const char* key,
                                                              int count,
                                                              Presence presence) {
  const toml::node* found = find(key, presence);
  if (found == nullptr) return std::nullopt;
  constexpr double kLargest = std::numeric_limits<int>::max();
  std::vector<int> integers;
  const auto numbers = numbers_within(*found, count, kLargest);
  for (const double number : numbers.value_or(std::vector<double>())) {
    if (number != std::round(number)) break;
    integers.push_back(static_cast<int>(number));
  }
  if (integers.size() == static_cast<std::size_t>(count)) return integers;
  add_problem(key, "must be a list of " + std::to_string(count) + " whole numbers");
  return std::nullopt;
}

std::optional<Eigen::MatrixXd> TomlTableReader::get_matrix(
    const char* key, int rows, int columns, Presence presence, double most, RowGaps gaps) {
  const toml::node* found = find(key, presence);
  if (found == nullptr) return std::nullopt;
  const toml::array* list = found->as_array();
  const bool size_fits =
      list != nullptr && (rows < 0 || list->size() == static_cast<std::size_t>(rows));
  const std::string wanted = "must be a list of " +
                             (rows < 0 ? std::string() : std::to_string(rows) + " ") + "lists of " +
                             std::to_string(columns) + wanted_numbers(most) +
                             (gaps == RowGaps::Allowed ? ", or [] for one that is absent" : "");
  if (!size_fits) {
    add_problem(key, wanted);
    return std::nullopt;
  }
  Eigen::MatrixXd matrix(static_cast<Eigen::Index>(list->size()), columns);
  for (std::size_t i = 0; i < list->size(); ++i) {
    if (gaps == RowGaps::Allowed && is_absent_row(*list->get(i), columns)) {
      matrix.row(static_cast<Eigen::Index>(i)).setConstant(std::nan(""));
      continue;
    }
    const auto row = numbers_within(*list->get(i), columns, most);
    if (!row) {
      problems_.add(*list->get(i),
                    prefix_ + key + "[" + std::to_string(i) + "] = " + value_text(*list->get(i)) +
                        ": " + key + " " + wanted);
      return std::nullopt;
    }
    matrix.row(static_cast<Eigen::Index>(i)) =
        Eigen::Map<const Eigen::RowVectorXd>(row->data(), columns);
  }
  return matrix;
}

std::optional<RigidTransform> TomlTableReader::get_pose(const char* key, Presence presence) {
  const auto matrix = get_matrix(key, 4, 4, presence);
  if (!matrix) return std::nullopt;
  const auto not_rigid = rigidity_problems(*matrix);
  for (const std::string& problem : not_rigid) add_problem(key, problem);
  if (!not_rigid.empty()) return std::nullopt;
  return rigid_from_matrix(*matrix);
}

std::vector<const toml::table*> TomlTableReader::get_tables(const char* key, Presence presence) {
  std::vector<const toml::table*> tables;
  const toml::node* found = find(key, presence);
  if (found == nullptr) return tables;
  const toml::array* list = found->as_array();
  if (list != nullptr)
    for (const toml::node& element : *list)
      if (const toml::table* table = element.as_table()) tables.push_back(table);
  const bool all_are_tables = list != nullptr && list->size() == tables.size();
  if (!all_are_tables || (tables.empty() && presence == Presence::Required)) {
    add_problem(key, "must be written as tables with the heading [[" + prefix_ + key + "]]");
    tables.clear();
  }
  return tables;
}

void TomlTableReader::refuse_unknown_keys() {
  for (const auto& [key, value] : table_) {
    const std::string name(key.str());
    if (known_keys_.count(name) > 0) continue;
    const std::string nearest = nearest_name(name, known_keys_);
    const std::string hint = nearest.empty() ? "" : ": did you mean \"" + nearest + "\"?";
    std::string owner = prefix_;
    if (!owner.empty()) owner.back() = ':';  // "case[0]." -> "case[0]:"
    if (!owner.empty()) owner += ' ';
    problems_.add(value,
                  owner.append("unknown key \"")
                      .append(name.substr(0, kLongestKey))
                      .append("\"")
                      .append(hint));
  }
}

std::string toml_number(double value) {
  check(std::isfinite(value), "toml_number needs a finite value");
  std::string text = number_text(value);
  if (text.find_first_of(".e") == std::string::npos) text += ".0";  // a float, not an integer
  return text;
}

std::string toml_numbers(const Eigen::VectorXd& values) {
  std::string text = "[";
  for (Eigen::Index i = 0; i < values.size(); ++i)
    text += (i > 0 ? ", " : "") + toml_number(values[i]);
  return text + "]";
}

std::string toml_matrix(const Eigen::MatrixXd& matrix) {
  std::string text = "[";
  for (Eigen::Index row = 0; row < matrix.rows(); ++row)
    text += (row > 0 ? ", " : "") + toml_numbers(matrix.row(row).transpose());
  return text + "]";
}

}  // namespace af
