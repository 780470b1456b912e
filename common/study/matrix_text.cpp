// SPDX-License-Identifier: Apache-2.0
#include "study/matrix_text.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <vector>

#include "base/parsed_number.h"
#include "base/toml_text.h"
#include "files/toml_reader.h"

namespace af {

namespace {

constexpr std::size_t kColumns = 4;
constexpr std::size_t kNumbers = 12;

/// Words of a line between blanks, commas, semicolons and brackets.
std::vector<std::string> words_of(std::string_view line) {
  constexpr std::string_view kSeparators = " \t\r,;[]";
  std::vector<std::string> words;
  for (std::size_t at = 0;;) {
    at = line.find_first_not_of(kSeparators, at);
    if (at == std::string_view::npos) return words;
    const std::size_t end = std::min(line.find_first_of(kSeparators, at), line.size());
    words.emplace_back(line.substr(at, end - at));
    at = end;
  }
}

std::vector<std::vector<std::string>> lines_of_words(std::string_view text) {
  std::vector<std::vector<std::string>> lines;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = std::min(text.find('\n', at), text.size());
    if (auto words = words_of(text.substr(at, end - at)); !words.empty())
      lines.push_back(std::move(words));
    at = end + 1;
  }
  return lines;
}

bool is_comment(const std::vector<std::string>& words) {
  return words.front().starts_with('#');
}

/// "[a, b]" of words from `first` on; empty when one is no number. The reader refuses infinite ones
/// itself, by the name of their key.
std::string list_of(const std::vector<std::string>& words, std::size_t first, std::size_t count) {
  std::string list;
  for (std::size_t i = first; i < first + count; ++i) {
    const auto number = i < words.size() ? parsed_number(words[i]) : std::nullopt;
    if (!number) return "";
    list += (list.empty() ? "[" : ", ") + (std::isfinite(*number) ? toml_number(*number) : "nan");
  }
  return list + "]";
}

/// Sizes are whole numbers.
std::string size_of(const std::vector<std::string>& words) {
  const bool is_size = words.size() == 4 &&
                       words[2].find_first_not_of("0123456789") == std::string::npos &&
                       words[3].find_first_not_of("0123456789") == std::string::npos;
  return is_size ? "[" + words[2] + ", " + words[3] + "]" : "";
}

}  // namespace

bool is_matrix_text(std::string_view text) {
  std::size_t rows = 0;
  for (const std::vector<std::string>& words : lines_of_words(text)) {
    if (is_comment(words)) continue;
    if ((words.size() != kColumns && words.size() != kNumbers) ||
        !std::ranges::all_of(words,
                             [](const auto& word) { return parsed_number(word).has_value(); }))
      return false;
    rows += words.size() / kColumns;
  }
  return rows > 0 && rows % 3 == 0;
}

std::string rig_toml_of_matrices(std::string_view text) {
  std::string isocenter;
  std::string cameras;
  std::map<std::string, std::string> stated;
  std::string rows;
  std::size_t row_count = 0;
  for (const std::vector<std::string>& words : lines_of_words(text)) {
    if (is_comment(words)) {
      if (words.size() < 3) continue;
      if (words[1] == "isocenter_point") isocenter = list_of(words, 2, 3);
      if (words[1] == "camera") stated["name"] = toml_text(words[2]);
      if (words[1] == "size_px") stated["size_px"] = size_of(words);
      if (words[1] == "pixel_spacing_mm") stated["pixel_spacing_mm"] = list_of(words, 2, 2);
      continue;
    }
    for (std::size_t at = 0; at < words.size(); at += kColumns, ++row_count)
      rows += (rows.empty() ? "" : ", ") + list_of(words, at, kColumns);
    if (row_count % 3 != 0) continue;
    cameras += "[[camera]]\nprojection_matrix = [" + rows + "]\n";
    for (const char* key : {"name", "size_px", "pixel_spacing_mm"}) {
      if (stated[key].empty()) return "";
      cameras += std::string(key) + " = " + stated[key] + "\n";
    }
    stated.clear();
    rows.clear();
  }
  return isocenter.empty() ? "" : "isocenter_point = " + isocenter + "\n" + cameras;
}

}  // namespace af
