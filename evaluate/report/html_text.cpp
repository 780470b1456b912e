// SPDX-License-Identifier: Apache-2.0
#include "evaluate/report/html_text.h"

#include <cctype>
#include <cstddef>
#include <cstdint>

#include "base/error.h"

namespace af::evaluation {

std::string escaped(std::string_view text) {
  std::string result;
  for (const char character : text) {
    switch (character) {
      case '&':
        result += "&amp;";
        break;
      case '<':
        result += "&lt;";
        break;
      case '>':
        result += "&gt;";
        break;
      case '"':
        result += "&quot;";
        break;
      case '\'':
        result += "&#39;";
        break;
      default:
        result += character;
    }
  }
  return result;
}

std::string base64(std::string_view bytes) {
  constexpr std::string_view kDigits =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string result;
  result.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    std::uint32_t group = 0;
    for (std::size_t j = 0; j < 3; ++j)
      group = group << 8 | (i + j < bytes.size() ? static_cast<std::uint8_t>(bytes[i + j]) : 0u);
    for (std::size_t j = 0; j < 4; ++j)
      result += i + j <= bytes.size() ? kDigits[group >> (18 - 6 * j) & 63u] : '=';
  }
  return result;
}

std::string element(const char* tag, std::string_view content, std::string_view css_class) {
  std::string result = std::string("<") + tag;
  if (!css_class.empty()) result += " class=\"" + escaped(css_class) + "\"";
  return result + ">" + std::string(content) + "</" + tag + ">\n";
}

std::string url_of(std::string_view path) {
  constexpr std::string_view kDigits = "0123456789ABCDEF";
  std::string result;
  for (const char character : path) {
    const auto code = static_cast<unsigned char>(character);
    if (std::isalnum(code) != 0 || std::string_view("-_.~/").find(character) != std::string::npos) {
      result += character;
    } else {
      result += '%';
      result += kDigits[code >> 4];
      result += kDigits[code & 15u];
    }
  }
  return result;
}

namespace {

std::string class_of(const HtmlTable::Column& column) {
  if (!column.is_printed) return " class=\"on-screen\"";
  return column.is_numeric ? " class=\"number\"" : "";
}

}  // namespace

HtmlTable::HtmlTable(std::vector<Column> columns, std::string title)
    : columns_(std::move(columns)), title_(std::move(title)) {}

void HtmlTable::add_row(const std::vector<std::string>& cells, std::string_view css_class) {
  check(cells.size() == columns_.size(), "a table row has a cell per column");
  std::string row;
  for (std::size_t i = 0; i < cells.size(); ++i)
    row += "<td" + class_of(columns_[i]) + ">" + cells[i] + "</td>";
  rows_ += element("tr", row, css_class);
}

std::string HtmlTable::html() const {
  std::string head;
  for (const Column& column : columns_)
    head += "<th scope=\"col\"" + class_of(column) + ">" + escaped(column.title) + "</th>";
  const std::string table =
      element("table", element("thead", element("tr", head)) + element("tbody", rows_));
  return (title_.empty() ? "" : element("p", title_, "table-title")) +
         element("div", table, "scroll");
}

std::string definition_list(const std::vector<std::pair<std::string, std::string>>& items) {
  std::string content;
  for (const auto& [term, definition] : items)
    content += element("dt", escaped(term)) + element("dd", definition);
  return element("dl", content);
}

std::string figure(std::string_view picture_bytes,
                   const char* type,
                   std::string_view alternative,
                   std::string_view caption,
                   std::string_view css_class) {
  const std::string image = std::string("<img alt=\"") + escaped(alternative) +
                            "\" src=\"data:" + type + ";base64," + base64(picture_bytes) + "\">\n";
  return element("figure", image + element("figcaption", caption), css_class);
}

}  // namespace af::evaluation
