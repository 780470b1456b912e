// SPDX-License-Identifier: Apache-2.0
#include "figures/gnuplot_figure.h"

#include <array>
#include <cerrno>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <fcntl.h>
#include <filesystem>
#include <fstream>
#include <spawn.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/error.h"
#include "files/captured_output.h"
#include "files/output_file.h"
#include "text/csv_table.h"

extern char** environ;

namespace af {
namespace {

constexpr const char* kNotFound =
    "the program 'gnuplot' cannot be run; on Debian: apt-get install gnuplot-nox";

/// A file without a name, in memory, that ends with this object.
class MemoryFile {
 public:
  MemoryFile() : descriptor_(memfd_create("figure", MFD_CLOEXEC)) {
    if (descriptor_ < 0)
      throw FileError("a file in memory",
                      std::string("cannot be created: ") + std::strerror(errno));
  }
  ~MemoryFile() { close(descriptor_); }
  MemoryFile(const MemoryFile&) = delete;
  MemoryFile& operator=(const MemoryFile&) = delete;

  [[nodiscard]] int descriptor() const { return descriptor_; }
  [[nodiscard]] std::string path() const { return kFolder + std::to_string(descriptor_); }

  /// Where a process finds its open files.
  static constexpr const char* kFolder = "/proc/self/fd/";

 private:
  int descriptor_;
};

/// Exit status of "gnuplot ARGUMENT", with a standard input, what it says going to `log`, its
/// standard output to an open file; throws when it cannot be started.
int run_gnuplot(const std::string& argument,
                const MemoryFile& input,
                const MemoryFile& log,
                int output) {
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, input.descriptor(), STDIN_FILENO);
  posix_spawn_file_actions_adddup2(&actions, log.descriptor(), STDERR_FILENO);
  posix_spawn_file_actions_adddup2(&actions, output, STDOUT_FILENO);
  // -d: no personal or system-wide settings.
  std::array<std::string, 3> words = {"gnuplot", "-d", argument};
  std::array<char*, 4> arguments = {words[0].data(), words[1].data(), words[2].data(), nullptr};
  pid_t process = 0;
  const int error = posix_spawnp(&process, "gnuplot", &actions, nullptr, arguments.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (error != 0) throw FileError("gnuplot", kNotFound);
  int status = 0;
  while (waitpid(process, &status, 0) < 0)
    if (errno != EINTR)
      throw FileError("gnuplot", std::string("was lost: ") + std::strerror(errno));
  return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

/// What a script draws. gnuplot does not notice a full disk, so it is not let near one.
std::string drawn(const std::string& script, const std::filesystem::path& figure) {
  const MemoryFile script_file;
  const MemoryFile log;
  if (!(std::ofstream(script_file.path()) << script << std::flush))
    throw FileError(figure.string(), "its script cannot be kept in memory");
  int status = 0;
  // gnuplot ends at the first error of a file that is named, not of its standard input.
  const std::string input = MemoryFile::kFolder + std::to_string(STDIN_FILENO);
  std::string content = captured_output(
      figure.string(), [&](int output) { status = run_gnuplot(input, script_file, log, output); });
  if (status == 0) return content;
  throw FileError(figure.string(),
                  "gnuplot failed with status " + std::to_string(status) + ": " +
                      read_own_text_file(log.path()));
}

void replace_first(std::string& text, const std::string& from, const std::string& to) {
  const std::size_t position = text.find(from);
  if (position != std::string::npos) text.replace(position, from.size(), to);
}

std::string xml_escaped(std::string_view text) {
  std::string result;
  for (const char character : text) {
    if (character == '&')
      result += "&amp;";
    else if (character == '<')
      result += "&lt;";
    else
      result += character;
  }
  return result;
}

/// gnuplot writes colours as rgb(...), with and without blanks. This replaces the neutral ones,
/// blue and vermilion, so that they follow the reader's colour scheme.
constexpr const char* kDarkStyle =
    "<style>@media (prefers-color-scheme: dark) {"
    "[fill='rgb(31,41,51)'], [fill='rgb( 31,  41,  51)'] { fill: #DDE4EC }"
    "[stroke='rgb( 31,  41,  51)'] { stroke: #93A1B2 }"
    "[fill='rgb(107,122,140)'] { fill: #A9B5C3 }"
    "[stroke='rgb(107, 122, 140)'] { stroke: #A9B5C3 }"
    "[stroke='rgb(216, 222, 230)'] { stroke: #364352 }"
    "[stroke='rgb(  0, 114, 178)'] { stroke: #4FA8DE }"
    "[fill='rgb(  0, 114, 178)'] { fill: #4FA8DE }"
    "[color='rgb(  0, 114, 178)'] { color: #4FA8DE }"
    "[stroke='rgb(213,  94,   0)'] { stroke: #F0904F }"
    "[fill='rgb(213,  94,   0)'] { fill: #F0904F }"
    "[color='rgb(213,  94,   0)'] { color: #F0904F }"
    "[color='white'] { color: #12171D }"
    "}</style>\n";

std::string finished_svg(std::string svg, const std::string& title) {
  replace_first(
      svg, "<title>Gnuplot</title>", "<title>" + xml_escaped(title) + "</title>\n" + kDarkStyle);
  return svg;
}

}  // namespace

std::string gnuplot_quoted(std::string_view text) {
  std::string result = "'";
  for (const char character : text) {
    if (character == '\'')
      result += "''";
    else
      result += static_cast<unsigned char>(character) < 0x20 ? ' ' : character;
  }
  return result + "'";
}

void require_gnuplot() {
  const MemoryFile nothing;
  const MemoryFile log;
  int status = 0;
  captured_output("gnuplot",
                  [&](int output) { status = run_gnuplot("--version", nothing, log, output); });
  if (status != 0) throw FileError("gnuplot", kNotFound);
}

GnuplotFigure::GnuplotFigure(std::string title, int width_px, int height_px)
    : title_(std::move(title)), width_px_(width_px), height_px_(height_px) {}

void GnuplotFigure::add_data(const std::string& name,
                             const std::vector<std::vector<double>>& rows) {
  body_ += "$" + name + " << END_OF_DATA\n";
  for (const std::vector<double>& row : rows) {
    for (std::size_t i = 0; i < row.size(); ++i) {
      check(!std::isinf(row[i]), "a figure's data are finite or NaN");
      body_ += (i == 0 ? "" : " ") + (std::isnan(row[i]) ? "NaN" : number_text(row[i]));
    }
    body_ += '\n';
  }
  body_ += "END_OF_DATA\n";
}

void GnuplotFigure::add(const std::string& script_lines) {
  body_ += script_lines + "\n";
}

std::string GnuplotFigure::script(const std::string& terminal) const {
  const std::string ink = "rgb '" + std::string(palette::kInk) + "'";
  const std::string grid = "rgb '" + std::string(palette::kGrid) + "'";
  return "set encoding utf8\nset terminal " + terminal +
         "\nset datafile missing 'NaN'\nset border 3 lc " + ink +
         "\nset xtics nomirror out scale 0.6 textcolor " + ink +
         "\nset ytics nomirror out scale 0.6 textcolor " + ink + "\nset grid ytics lt 1 lc " +
         grid + " dt 1 lw 1\nset key textcolor " + ink + "\nset title " + gnuplot_quoted(title_) +
         " textcolor " + ink + "\nset xlabel textcolor " + ink + "\nset ylabel textcolor " + ink +
         "\n" + body_;
}

void GnuplotFigure::draw(const std::filesystem::path& path_without_extension) const {
  const std::string width = std::to_string(width_px_);
  const std::string height = std::to_string(height_px_);
  const std::filesystem::path svg = path_without_extension.string() + ".svg";
  const std::filesystem::path png = path_without_extension.string() + ".png";
  const std::string svg_terminal = "svg size " + width + "," + height +
                                   " dynamic noenhanced font 'DejaVu Sans,Helvetica,sans-serif,14'";
  const std::string png_terminal =
      "pngcairo size " + std::to_string(2 * width_px_) + "," + std::to_string(2 * height_px_) +
      " noenhanced font 'DejaVu Sans,11' fontscale 2 linewidth 2 pointscale 2 "
      "background '#FFFFFF'";
  write_text_file(svg, finished_svg(drawn(script(svg_terminal), svg), title_));
  write_text_file(png, drawn(script(png_terminal), png));
}

}  // namespace af
