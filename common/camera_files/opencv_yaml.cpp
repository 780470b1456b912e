// SPDX-License-Identifier: Apache-2.0
#include "camera_files/opencv_yaml.h"

#include <algorithm>
#include <optional>

#include "base/error.h"
#include "base/toml_text.h"
#include "camera_files/camera_file.h"

namespace af {

namespace {

/// More numbers than any matrix of a camera has.
constexpr std::size_t kMostNumbers = 4096;

/// An entry as its lines give it.
struct OpenEntry {
  std::string key;
  std::size_t line = 0;
  std::string text;
  std::map<std::string, std::string> parts;  ///< "rows", "cols", "data" of a matrix
};

/// What stands before and behind the first ": " or final ':' of a line; nullopt when there is none.
std::optional<std::pair<std::string_view, std::string_view>> key_and_value(std::string_view line) {
  const std::size_t colon = line.find(':');
  if (colon == std::string_view::npos || colon == 0) return std::nullopt;
  if (colon + 1 < line.size() && line[colon + 1] != ' ' && line[colon + 1] != '\t')
    return std::nullopt;
  std::string_view key = trimmed_view(line.substr(0, colon));
  if (key.size() > 1 && key.front() == '"' && key.back() == '"')
    key = key.substr(1, key.size() - 2);
  return std::pair(key, trimmed_view(line.substr(colon + 1)));
}

/// Whether a line is an item of a block list, "- 0.5" or "-", and no negative number.
bool is_block_item(std::string_view line) {
  return line.starts_with('-') && (line.size() == 1 || line[1] == ' ' || line[1] == '\t');
}

std::string_view without_comment(std::string_view line) {
  if (line.starts_with('#')) return {};
  return trimmed_view(line.substr(0, line.find(" #")));
}

/// An item without its dashes, of which items of nested lists have several.
std::string_view item_text(std::string_view line) {
  while (is_block_item(line)) line = trimmed_view(line.substr(1));
  return without_comment(line);
}

class YamlParser {
 public:
  explicit YamlParser(std::string file) : file_(std::move(file)) {}

  std::map<std::string, YamlValue> run(std::string_view text) {
    std::size_t number = 0;
    for (std::size_t at = 0; at < text.size();) {
      const std::size_t end = std::min(text.find('\n', at), text.size());
      take_line(text.substr(at, end - at), ++number);
      at = end + 1;
    }
    if (list_ != nullptr) throw FileError(place(entry_.line), "truncated: a list is not closed");
    finish();
    return std::move(values_);
  }

 private:
  [[nodiscard]] std::string place(std::size_t line) const {
    return file_ + ":" + std::to_string(line);
  }

  void take_line(std::string_view line, std::size_t number) {
    const bool is_indented = !line.empty() && (line.front() == ' ' || line.front() == '\t');
    line = trimmed_view(line);
    if (list_ != nullptr) return take_list(line);
    if (line.empty() || line.front() == '#' || line.front() == '%' || line == "---" ||
        line == "...")
      return;
    if (is_block_item(line)) return take_item(item_text(line));
    const auto pair = key_and_value(line);
    if (!pair && !is_indented)
      throw FileError(place(number), "'" + beginning_of(line, 60) + "' is no 'key: value'");
    if (!pair) return;
    if (!is_indented) {
      finish();
      entry_ = {std::string(pair->first), number, "", {}};
      take_value(entry_.text, pair->second);
    } else if (!entry_.key.empty()) {
      take_value(entry_.parts[std::string(pair->first)], pair->second);
    }
  }

  void take_value(std::string& into, std::string_view value) {
    block_ = nullptr;
    if (value.starts_with('[')) return start_list(into, value);
    into = std::string(value);
    if (without_comment(value).empty()) block_ = &into;
  }

  /// Items of a block list, one per line or a flow list per line, make one list.
  void take_item(std::string_view item) {
    if (block_ == nullptr) return;
    if (!block_->starts_with('[')) *block_ = "[ ";
    if (item.starts_with('[')) return start_list(*block_, item);
    block_->append(item).push_back(' ');
  }

  void start_list(std::string& into, std::string_view line) {
    list_ = &into;
    open_brackets_ = 0;
    take_list(line);
  }

  /// Lists go on until their bracket is closed, over any number of lines.
  void take_list(std::string_view line) {
    line = without_comment(line);
    list_->append(line).push_back(' ');
    open_brackets_ += std::ranges::count(line, '[') - std::ranges::count(line, ']');
    if (open_brackets_ <= 0) list_ = nullptr;
  }

  [[nodiscard]] Eigen::VectorXd list_numbers(const std::string& text) const {
    const auto lines = word_lines(text);
    const std::size_t count = lines.empty() ? 0 : lines.front().words.size();
    if (count > kMostNumbers)
      throw FileError(place(entry_.line), entry_.key + " has more numbers than any camera");
    Eigen::VectorXd numbers(static_cast<Eigen::Index>(count));
    for (std::size_t i = 0; i < count; ++i)
      numbers[static_cast<Eigen::Index>(i)] =
          number_of(lines.front().words[i], place(entry_.line) + ": " + entry_.key);
    return numbers;
  }

  [[nodiscard]] Eigen::MatrixXd matrix() const {
    const auto extent = [&](const char* key) {
      const auto found = entry_.parts.find(key);
      if (found == entry_.parts.end())
        throw FileError(place(entry_.line), "the matrix " + entry_.key + " has no '" + key + "'");
      const double number = number_of(found->second, place(entry_.line) + ": " + key);
      if (!(number >= 1.0 && number <= static_cast<double>(kMostNumbers)) ||
          number != static_cast<double>(static_cast<int>(number)))
        throw FileError(place(entry_.line), entry_.key + ": '" + key + "' = " + found->second);
      return static_cast<Eigen::Index>(number);
    };
    const Eigen::Index rows = extent("rows");
    const Eigen::Index columns = extent("cols");
    const Eigen::VectorXd numbers = list_numbers(entry_.parts.at("data"));
    if (numbers.size() != rows * columns)
      throw FileError(place(entry_.line),
                      "the matrix " + entry_.key,
                      std::to_string(rows * columns) + " numbers",
                      std::to_string(numbers.size()));
    return Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(
        numbers.data(), rows, columns);
  }

  void finish() {
    if (entry_.key.empty()) return;
    YamlValue value;
    value.line = entry_.line;
    const bool is_matrix =
        entry_.text.find("opencv-matrix") != std::string::npos || entry_.parts.contains("data");
    if (is_matrix && !entry_.parts.contains("data"))
      throw FileError(place(entry_.line), "the matrix " + entry_.key + " has no 'data'");
    if (is_matrix)
      value.numbers = matrix();
    else if (entry_.text.starts_with('[') && is_number(first_word(entry_.text)))
      value.numbers = list_numbers(entry_.text).transpose();
    else if (is_number(entry_.text))
      value.numbers = Eigen::MatrixXd::Constant(
          1, 1, number_of(entry_.text, place(entry_.line) + ": " + entry_.key));
    else
      value.text = unquoted(entry_.text);
    if (!values_.emplace(entry_.key, value).second)
      throw FileError(place(entry_.line), "the key " + entry_.key + " is there twice");
    entry_ = {};
    block_ = nullptr;
  }

  static std::string first_word(const std::string& text) {
    const auto lines = word_lines(text);
    return lines.empty() || lines.front().words.empty() ? ""
                                                        : std::string(lines.front().words.front());
  }

  static std::string unquoted(const std::string& text) {
    const bool is_quoted = text.size() > 1 && text.front() == text.back() &&
                           (text.front() == '"' || text.front() == '\'');
    return is_quoted ? text.substr(1, text.size() - 2) : text;
  }

  std::string file_;
  std::map<std::string, YamlValue> values_;
  OpenEntry entry_;
  std::string* list_ = nullptr;   ///< that goes on in the next line
  std::string* block_ = nullptr;  ///< that items in the next lines belong to
  std::ptrdiff_t open_brackets_ = 0;
};

}  // namespace

std::map<std::string, YamlValue> parse_opencv_yaml(std::string_view text, const std::string& file) {
  return YamlParser(file).run(text);
}

}  // namespace af
