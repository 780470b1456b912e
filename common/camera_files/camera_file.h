// SPDX-License-Identifier: Apache-2.0
// A file that may state cameras, as the format readers see it, and parsing of its numbers.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

namespace af {

/// The beginning of a file, and all of it when it is text.
struct CameraFile {
  std::filesystem::path path;
  std::string head;  ///< the first bytes, at most kHeadBytes
  std::string text;  ///< everything, when it is text of at most kMostTextBytes; empty otherwise

  static constexpr std::size_t kHeadBytes = 4096;
  static constexpr std::size_t kMostTextBytes = std::size_t{64} << 20;

  /// FileError when the file cannot be opened.
  static CameraFile open(const std::filesystem::path& path);

  [[nodiscard]] std::string name() const { return path.string(); }
};

/// A line of text, cut into words at blanks, commas, semicolons and brackets.
struct WordLine {
  std::size_t number = 0;  ///< from 1
  std::string_view text;   ///< without blanks around it
  std::vector<std::string_view> words;
};

/// Lines that hold anything, of a text whose lines end in CR, LF or both. What follows `comment`
/// is left out ('\0': there are no comments). The text must outlive the lines.
std::vector<WordLine> word_lines(std::string_view text, char comment = '\0');

/// True when all of it is a number, also "nan" and "inf".
bool is_number(std::string_view word);

/// A finite number. FileError when the word is no number, InputError when it is not finite;
/// `place` is "FILE:LINE: what".
double number_of(std::string_view word, const std::string& place);

/// Exactly `count` numbers of a line. FileError when there are fewer or more.
Eigen::VectorXd numbers_of(const WordLine& line, Eigen::Index count, const std::string& file);

/// Columns and rows of images. InputError unless both are whole and within 1 and 32768.
Eigen::Vector2i size_of(const Eigen::Vector2d& numbers, const std::string& place);

/// "FILE:LINE".
std::string place_of(const WordLine& line, const std::string& file);

/// Trimmed of blanks and line ends.
std::string_view trimmed_view(std::string_view text);

}  // namespace af
