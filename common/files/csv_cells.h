// SPDX-License-Identifier: Apache-2.0
// Rows in which every field stands beside the name of its column, and tables made of them.
#pragma once

#include <concepts>
#include <iterator>
#include <ranges>
#include <string>
#include <utility>
#include <vector>

#include "base/number_text.h"
#include "files/csv_table.h"

namespace af {

struct CsvCell {
  std::string column;
  std::string text;

  CsvCell(std::string name, std::string value) : column(std::move(name)), text(std::move(value)) {}
  CsvCell(std::string name, const char* value) : CsvCell(std::move(name), std::string(value)) {}
  CsvCell(std::string name, double value) : CsvCell(std::move(name), number_text(value)) {}
  /// A bool is 0 or 1.
  template <std::integral Number>
  CsvCell(std::string name, Number value) : CsvCell(std::move(name), std::to_string(value)) {}
};

using CsvCells = std::vector<CsvCell>;

inline void append(CsvCells more, CsvCells& cells) {
  cells.insert(
      cells.end(), std::make_move_iterator(more.begin()), std::make_move_iterator(more.end()));
}

/// A cell for each name, with the value at its place.
template <typename Names, typename Values>
void append(const std::string& prefix, const Names& names, const Values& values, CsvCells& cells) {
  auto value = std::begin(values);
  for (const auto& name : names) cells.emplace_back(prefix + name, *value++);
}

inline std::vector<std::string> columns_of(const CsvCells& cells) {
  std::vector<std::string> columns;
  for (const CsvCell& cell : cells) columns.push_back(cell.column);
  return columns;
}

inline void add_row(CsvCells cells, CsvTable& table) {
  std::vector<std::string> fields;
  fields.reserve(cells.size());
  for (CsvCell& cell : cells) fields.push_back(std::move(cell.text));
  table.add_row(std::move(fields));
}

/// A table of `rows`. `cells_of` gives the cells of a row, and also the columns where there is no
/// row.
template <std::ranges::range Rows, typename CellsOf>
CsvTable csv_table(const Rows& rows, const CellsOf& cells_of) {
  CsvTable table(columns_of(cells_of(std::ranges::range_value_t<Rows>())));
  for (const auto& row : rows) add_row(cells_of(row), table);
  return table;
}

/// The columns are those of the first row. Without rows there are none.
inline CsvTable csv_table(std::vector<CsvCells> rows) {
  CsvTable table(rows.empty() ? std::vector<std::string>() : columns_of(rows.front()));
  for (CsvCells& row : rows) add_row(std::move(row), table);
  return table;
}

}  // namespace af
