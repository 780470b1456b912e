// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/number_text.h"

namespace af {

/// A CSV file with a header line, in memory, with values as text. RFC 4180 quoting. Where the
/// header has semicolons and no comma, semicolons separate fields and numbers may have a decimal
/// comma.
class CsvTable {
 public:
  explicit CsvTable(std::vector<std::string> columns) : columns_(std::move(columns)) {}
  /// Throws FileError naming path and line when a row has the wrong number of fields, quotes are
  /// unbalanced, a column name is repeated, a row has more than 64 MiB, or the file is empty.
  static CsvTable read(const std::filesystem::path& path);
  /// Reads a file that is too long for memory in tables of a few thousand rows each, in order, and
  /// at least one table. Throws FileError as read() does, after the parts before the error have
  /// been received.
  /// \test CsvTable.IsReadInPartsLikeAsAWhole
  static void read_in_parts(const std::filesystem::path& path,
                            const std::function<void(const CsvTable& part)>& receive);

  void add_row(std::vector<std::string> fields);
  [[nodiscard]] std::size_t row_count() const { return rows_.size(); }
  [[nodiscard]] const std::vector<std::string>& columns() const { return columns_; }
  [[nodiscard]] std::optional<std::size_t> find_column(std::string_view name) const;
  [[nodiscard]] const std::string& text(std::size_t row, std::string_view column) const;
  /// Throws FileError naming path, line, column and value when it is not a finite number.
  [[nodiscard]] double number(std::size_t row, std::string_view column) const;
  /// The same, or NaN where it says "nan".
  [[nodiscard]] double number_or_nan(std::size_t row, std::string_view column) const;
  /// "PATH:LINE" of a row, for messages.
  [[nodiscard]] std::string where(std::size_t row) const;
  [[nodiscard]] std::string to_text() const;
  /// to_text() without the header line.
  [[nodiscard]] std::string rows_text() const;

 private:
  class Parser;
  static CsvTable header_of(Parser& parser, const std::string& path);
  /// Adds rows up to the end of the file, or until there are `most`.
  void add_rows(Parser& parser, std::size_t most);

  std::vector<std::string> columns_;
  std::vector<std::vector<std::string>> rows_;
  std::vector<std::size_t> lines_;  ///< line of the file where each row begins
  std::string path_;
  bool has_decimal_commas_ = false;
};

/// Writes a table of `row_count` rows, a few thousand at a time, for tables too long to be held as
/// text. `table_of` gives rows [first, end). The file appears only when complete.
void write_csv_in_parts(
    const std::filesystem::path& path,
    std::size_t row_count,
    const std::function<CsvTable(std::size_t first, std::size_t end)>& table_of);

/// Text with a fixed number of decimals, for columns that people read.
std::string fixed_text(double value, int decimals);

}  // namespace af
