// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace af::evaluation {

/// Text as HTML: the characters that mean something to HTML become entities.
std::string escaped(std::string_view text);

/// Standard base64 with padding (RFC 4648).
std::string base64(std::string_view bytes);

/// <tag class="...">content</tag>; `content` is HTML, an empty class is left out.
std::string element(const char* tag, std::string_view content, std::string_view css_class = "");

/// A relative path as a link: blanks and what else means something in a URL become %XX.
std::string url_of(std::string_view path);

/// An HTML table that readers may sort by any column; cells are HTML. A wide one scrolls below its
/// title.
class HtmlTable {
 public:
  /// Column titles are text; numeric columns are right-aligned, and some are not printed.
  struct Column {
    std::string title;
    bool is_numeric = true;
    bool is_printed = true;
  };

  /// `title` is HTML.
  explicit HtmlTable(std::vector<Column> columns, std::string title = "");
  /// `css_class` of the row, e.g. "reference" (which sorting leaves at the end).
  void add_row(const std::vector<std::string>& cells, std::string_view css_class = "");
  [[nodiscard]] bool empty() const { return rows_.empty(); }
  [[nodiscard]] std::string html() const;

 private:
  std::vector<Column> columns_;
  std::string title_;
  std::string rows_;
};

/// A definition list of (text, HTML) pairs.
std::string definition_list(const std::vector<std::pair<std::string, std::string>>& items);

/// A figure whose picture, of MIME type `type`, is part of the page. `caption` is HTML;
/// `alternative` is text for readers who cannot see the picture.
std::string figure(std::string_view picture_bytes,
                   const char* type,
                   std::string_view alternative,
                   std::string_view caption,
                   std::string_view css_class = "");

}  // namespace af::evaluation
