// SPDX-License-Identifier: Apache-2.0
#include "camera_files/camera_file.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <optional>

#include "base/error.h"
#include "base/number_text.h"
#include "base/parsed_number.h"
#include "base/toml_text.h"
#include "files/input_file.h"
#include "files/input_guard.h"
#include "files/output_file.h"

namespace af {

namespace {

constexpr std::string_view kBlanks = " \t\r\n";

bool is_text_byte(char c) {
  return static_cast<unsigned char>(c) >= ' ' || c == '\n' || c == '\r' || c == '\t';
}

bool is_separator(char c) {
  return kBlanks.find(c) != std::string_view::npos || c == ',' || c == ';' || c == '[' || c == ']';
}

std::vector<std::string_view> words_of(std::string_view line) {
  std::vector<std::string_view> words;
  for (std::size_t at = 0; at < line.size();) {
    if (is_separator(line[at])) {
      ++at;
      continue;
    }
    const std::size_t begin = at;
    while (at < line.size() && !is_separator(line[at])) ++at;
    words.push_back(line.substr(begin, at - begin));
  }
  return words;
}

}  // namespace

CameraFile CameraFile::open(const std::filesystem::path& path) {
  note_input(path);
  CameraFile result;
  result.path = path;
  std::ifstream file = open_input_file(path);
  result.head.resize(kHeadBytes);
  file.read(result.head.data(), static_cast<std::streamsize>(kHeadBytes));
  result.head.resize(static_cast<std::size_t>(file.gcount()));
  const bool is_text =
      !result.head.empty() && std::all_of(result.head.begin(), result.head.end(), is_text_byte);
  if (is_text && std::filesystem::file_size(path) <= kMostTextBytes)
    result.text = read_text_file(path, kMostTextBytes);
  return result;
}

std::string_view trimmed_view(std::string_view text) {
  const std::size_t first = text.find_first_not_of(kBlanks);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(kBlanks) - first + 1);
}

std::vector<WordLine> word_lines(std::string_view text, char comment) {
  std::vector<WordLine> lines;
  std::size_t number = 0;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = std::min(text.find_first_of("\r\n", at), text.size());
    std::string_view line = text.substr(at, end - at);
    at = end + (text.substr(end, 2) == "\r\n" ? 2 : 1);
    ++number;
    if (comment != '\0') line = line.substr(0, line.find(comment));
    line = trimmed_view(line);
    if (!line.empty()) lines.push_back({number, line, words_of(line)});
  }
  return lines;
}

bool is_number(std::string_view word) {
  return parsed_number(word).has_value();
}

double number_of(std::string_view word, const std::string& place) {
  const std::optional<double> value = parsed_number(word);
  if (!value) throw FileError(place, "'" + std::string(word) + "' is no number");
  if (!std::isfinite(*value)) throw InputError(place, std::string(word), "must be finite");
  return *value;
}

Eigen::Vector2i size_of(const Eigen::Vector2d& numbers, const std::string& place) {
  constexpr double kMaxSide = 32768.0;
  for (const double number : numbers)
    if (!(number >= 1.0 && number <= kMaxSide) || number != std::floor(number))
      throw InputError(place,
                       number_text(number),
                       "the image's size must be a whole number between 1 and 32768");
  return numbers.cast<int>();
}

std::string place_of(const WordLine& line, const std::string& file) {
  return file + ":" + std::to_string(line.number);
}

Eigen::VectorXd numbers_of(const WordLine& line, Eigen::Index count, const std::string& file) {
  const std::string place = place_of(line, file);
  if (line.words.size() != static_cast<std::size_t>(count))
    throw FileError(place,
                    "expected " + std::to_string(count) + " numbers, found '" +
                        beginning_of(line.text, 100) + "'");
  Eigen::VectorXd numbers(count);
  for (Eigen::Index i = 0; i < count; ++i)
    numbers[i] = number_of(line.words[static_cast<std::size_t>(i)], place);
  return numbers;
}

}  // namespace af
