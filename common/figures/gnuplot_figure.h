// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace af {

/// Colours that people with any form of colour blindness tell apart (Okabe and Ito 2008), and the
/// neutral ones of axes and grids.
namespace palette {
inline constexpr std::string_view kBlue = "#0072B2";
inline constexpr std::string_view kVermilion = "#D55E00";
inline constexpr std::string_view kGreen = "#009E73";
inline constexpr std::string_view kPurple = "#CC79A7";
inline constexpr std::string_view kSkyBlue = "#56B4E9";
inline constexpr std::string_view kOrange = "#E69F00";
inline constexpr std::string_view kInk = "#1F2933";
inline constexpr std::string_view kQuiet = "#6B7A8C";
inline constexpr std::string_view kGrid = "#D8DEE6";
}  // namespace palette

/// One figure drawn by gnuplot (5.2 or later), which is run as a program: SVG, transparent and
/// readable on light and dark pages, and PNG on white at twice the size. The same calls give the
/// same bytes.
class GnuplotFigure {
 public:
  GnuplotFigure(std::string title, int width_px, int height_px);

  /// A block of numbers that plot commands call `$name`; NaN becomes a missing value, infinities
  /// are refused (check). Rows are equally long.
  void add_data(const std::string& name, const std::vector<std::vector<double>>& rows);
  /// Lines of gnuplot script, for example "set xlabel 'time (s)'".
  void add(const std::string& script_lines);

  /// Writes PATH.svg and PATH.png, atomically. FileError when gnuplot cannot be run or fails: names
  /// its message.
  void draw(const std::filesystem::path& path_without_extension) const;

 private:
  [[nodiscard]] std::string script(const std::string& terminal) const;

  std::string title_;
  int width_px_;
  int height_px_;
  std::string body_;
};

/// A text as a gnuplot string literal.
std::string gnuplot_quoted(std::string_view text);

/// FileError that says which package to install when gnuplot cannot be run. To be called before
/// long work whose results are drawn.
void require_gnuplot();

}  // namespace af
