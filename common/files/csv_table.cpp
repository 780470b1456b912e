// SPDX-License-Identifier: Apache-2.0
#include "files/csv_table.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <optional>
#include <set>
#include <utility>

#include "base/error.h"
#include "base/number_text.h"
#include "base/parsed_number.h"
#include "files/input_guard.h"
#include "files/output_file.h"

namespace af {

namespace {

constexpr std::size_t kRowsPerPart = 4096;

struct Record {
  std::vector<std::string> fields;
  std::size_t line = 0;  ///< where it begins, from 1
};

std::string quoted_if_needed(const std::string& field) {
  if (field.find_first_of(",;\"\r\n") == std::string::npos && !field.starts_with(kByteOrderMark))
    return field;
  std::string quoted = "\"";
  for (const char character : field) {
    if (character == '"') quoted.push_back('"');
    quoted.push_back(character);
  }
  return quoted + '"';
}

void append_line(std::string& text, const std::vector<std::string>& fields) {
  // A single empty field would be an empty line, which readers skip.
  if (fields.size() == 1 && fields[0].empty()) {
    text += "\"\"\n";
    return;
  }
  for (std::size_t i = 0; i < fields.size(); ++i) {
    if (i > 0) text.push_back(',');
    text += quoted_if_needed(fields[i]);
  }
  text.push_back('\n');
}

std::string_view trimmed(std::string_view text) {
  constexpr std::string_view kBlanks = " \t";
  const std::size_t first = text.find_first_not_of(kBlanks);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(kBlanks) - first + 1);
}

}  // namespace

/// Splits CSV text into records (RFC 4180; LF or CRLF). Excel writes semicolons between fields
/// where numbers have decimal commas.
class CsvTable::Parser {
 public:
  /// `next_part` gives the text in parts, and an empty one at its end.
  Parser(std::function<std::string_view()> next_part, const std::string& path)
      : next_part_(std::move(next_part)), path_(path), part_(next_part_()) {
    const std::string_view header = part_.substr(0, part_.find('\n'));
    if (header.find(',') == std::string_view::npos && header.find(';') != std::string_view::npos)
      separator_ = ';';
  }

  [[nodiscard]] bool has_semicolons() const { return separator_ == ';'; }

  [[nodiscard]] bool at_end() {
    if (position_ == part_.size() && !part_.empty()) {
      offset_ += part_.size();
      part_ = next_part_();
      position_ = 0;
    }
    return part_.empty();
  }

  Record next_record() {
    Record record{{}, line_};
    begin_ = offset_ + position_;
    do record.fields.push_back(peek() == '"' ? quoted_field() : plain_field());
    while (take(separator_));
    take('\n');
    ++line_;
    return record;
  }

 private:
  /// The next character, or a line end after the last one.
  [[nodiscard]] char peek() {
    if (at_end()) return '\n';
    const char next = part_[position_];
    const std::size_t offset = offset_ + position_;
    if (next == '\0')
      throw FileError(path_, "is not text: it has a zero byte at offset " + std::to_string(offset));
    if (offset - begin_ > kMostBytesOfARow)
      throw FileError(
          here(),
          "a row is larger than the " + std::to_string(kMostBytesOfARow) + " bytes allowed here");
    return next;
  }

  bool take(char expected) {
    if (at_end() || peek() != expected) return false;
    ++position_;
    return true;
  }

  [[nodiscard]] bool is_at_separator() { return peek() == separator_ || peek() == '\n'; }

  [[nodiscard]] std::string here() const { return path_ + ":" + std::to_string(line_); }

  std::string plain_field() {
    std::string field;
    for (; !is_at_separator(); ++position_) {
      if (peek() == '"')
        throw FileError(here(), "a quote inside a field that does not begin with one");
      field.push_back(peek());
    }
    // A carriage return that ends a line does not belong to the field.
    if (field.ends_with('\r') && peek() == '\n') field.pop_back();
    return field;
  }

  std::string quoted_field() {
    const std::string start = here();
    std::string field;
    for (++position_;; ++position_) {
      if (at_end()) throw FileError(start, "a quote is opened here and never closed");
      const char character = peek();
      if (character == '\n') ++line_;
      if (character != '"') {
        field.push_back(character);
        continue;
      }
      ++position_;
      if (at_end() || peek() != '"') break;
      field.push_back('"');
    }
    const bool is_end_of_line = take('\r');
    if (is_end_of_line ? peek() != '\n' : !is_at_separator())
      throw FileError(here(), "text after the closing quote of a field");
    return field;
  }

  static constexpr std::size_t kMostBytesOfARow = std::size_t{64} << 20;

  std::function<std::string_view()> next_part_;
  const std::string& path_;
  std::string_view part_;
  char separator_ = ',';
  std::size_t position_ = 0;  ///< in the part
  std::size_t offset_ = 0;    ///< of the part in the text
  std::size_t begin_ = 0;     ///< of the row in the text
  std::size_t line_ = 1;
};

CsvTable CsvTable::header_of(Parser& parser, const std::string& path) {
  if (parser.at_end()) throw FileError(path, "is empty; a header line was expected");
  CsvTable table(parser.next_record().fields);
  table.path_ = path;
  table.has_decimal_commas_ = parser.has_semicolons();
  std::set<std::string_view> seen;
  for (const std::string& column : table.columns_)
    if (!seen.insert(column).second)
      throw FileError(path + ":1", "the column name '" + column + "' is repeated");
  return table;
}

void CsvTable::add_rows(Parser& parser, std::size_t most) {
  while (rows_.size() < most && !parser.at_end()) {
    Record record = parser.next_record();
    const bool blank_last_line = parser.at_end() && record.fields.size() == 1 &&
                                 trimmed(record.fields[0]).empty() && columns_.size() > 1;
    if (blank_last_line) break;
    if (record.fields.size() != columns_.size())
      throw FileError(path_ + ":" + std::to_string(record.line),
                      "number of fields",
                      std::to_string(columns_.size()),
                      std::to_string(record.fields.size()));
    rows_.push_back(std::move(record.fields));
    lines_.push_back(record.line);
  }
}

CsvTable CsvTable::read(const std::filesystem::path& path) {
  const std::string name = path.string();
  const std::string text = read_text_file(path);
  std::string_view rest = text;
  Parser parser([&] { return std::exchange(rest, {}); }, name);
  CsvTable table = header_of(parser, name);
  table.add_rows(parser, std::numeric_limits<std::size_t>::max());
  return table;
}

void CsvTable::read_in_parts(const std::filesystem::path& path,
                             const std::function<void(const CsvTable& part)>& receive) {
  const std::string name = path.string();
  note_input(path);
  TextParts text(path);
  Parser parser([&] { return text.next(); }, name);
  const CsvTable header = header_of(parser, name);
  do {
    CsvTable part = header;
    part.add_rows(parser, kRowsPerPart);
    receive(part);
  } while (!parser.at_end());
}

void CsvTable::add_row(std::vector<std::string> fields) {
  check(fields.size() == columns_.size(),
        "a CSV row must have as many fields as the table columns");
  rows_.push_back(std::move(fields));
  lines_.push_back(rows_.size() + 1);
}

std::optional<std::size_t> CsvTable::find_column(std::string_view name) const {
  const auto found = std::find(columns_.begin(), columns_.end(), name);
  if (found == columns_.end()) return std::nullopt;
  return static_cast<std::size_t>(found - columns_.begin());
}

const std::string& CsvTable::text(std::size_t row, std::string_view column) const {
  check(row < rows_.size(), "CSV row beyond the table");
  const auto index = find_column(column);
  if (!index)
    throw FileError(path_.empty() ? "table" : path_, "has no column '" + std::string(column) + "'");
  return rows_[row][*index];
}

double CsvTable::number(std::size_t row, std::string_view column) const {
  const std::string& value = text(row, column);
  std::string number(trimmed(value));
  if (has_decimal_commas_) std::ranges::replace(number, ',', '.');
  if (const auto parsed = finite_number(number)) return *parsed;
  throw FileError(where(row), std::string(column), "a finite number", "'" + value + "'");
}

double CsvTable::number_or_nan(std::size_t row, std::string_view column) const {
  return text(row, column) == "nan" ? std::numeric_limits<double>::quiet_NaN()
                                    : number(row, column);
}

std::string CsvTable::where(std::size_t row) const {
  check(row < rows_.size(), "CSV row beyond the table");
  return (path_.empty() ? "table" : path_) + ":" + std::to_string(lines_[row]);
}

std::string CsvTable::to_text() const {
  std::string text;
  append_line(text, columns_);
  return text + rows_text();
}

std::string CsvTable::rows_text() const {
  std::string text;
  for (const auto& row : rows_) append_line(text, row);
  return text;
}

void write_csv_in_parts(
    const std::filesystem::path& path,
    std::size_t row_count,
    const std::function<CsvTable(std::size_t first, std::size_t end)>& table_of) {
  std::size_t first = 0;
  bool has_header = false;
  write_text_in_parts(path, [&]() -> std::string {
    if (has_header && first == row_count) return "";
    const std::size_t end = std::min(row_count, first + kRowsPerPart);
    const CsvTable part = table_of(std::exchange(first, end), end);
    return std::exchange(has_header, true) ? part.rows_text() : part.to_text();
  });
}

std::string fixed_text(double value, int decimals) {
  if (!std::isfinite(value)) return number_text(value);
  constexpr int kMaxDecimals = 60;
  check(decimals >= 0 && decimals <= kMaxDecimals, "fixed_text: decimals must be within 0 and 60");
  std::string text(400, '\0');  // 1.8e308 has 309 digits before the point
  const auto [end, error] = std::to_chars(
      text.data(), text.data() + text.size(), value, std::chars_format::fixed, decimals);
  check(error == std::errc(), "fixed_text: buffer too small");
  text.resize(static_cast<std::size_t>(end - text.data()));
  if (text.starts_with('-') && text.find_first_not_of("-0.") == std::string::npos) text.erase(0, 1);
  return text;
}

}  // namespace af
