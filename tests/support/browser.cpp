// SPDX-License-Identifier: Apache-2.0
#include "support/browser.h"

#include <fstream>
#include <sstream>
#include <stdexcept>

#include "support/run_program.h"

namespace af::test {
namespace {

std::string text_of(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

/// Of all lines that a browser logs, those of the page itself.
std::string console_lines(const std::string& log) {
  std::istringstream lines(log);
  std::string found;
  for (std::string line; std::getline(lines, line);)
    if (line.find("CONSOLE") != std::string::npos) found += line + "\n";
  return found;
}

}  // namespace

bool has_browser() {
  return run_command("command -v chromium").exit_code == 0;
}

BrowserPage open_in_browser(const std::filesystem::path& page,
                            const std::filesystem::path& scratch) {
  const std::filesystem::path log = scratch / "browser.log";
  const std::filesystem::path document = scratch / "browser.html";
  // A name server that finds nothing: every request of the page over a network fails.
  const ProgramRun run = run_command(
      "( timeout 120 chromium --headless --no-sandbox --disable-gpu --disable-dev-shm-usage "
      "--host-resolver-rules='MAP * ~NOTFOUND' --enable-logging=stderr --user-data-dir='" +
      (scratch / "browser-profile").string() + "' --dump-dom 'file://" + page.string() + "' >'" +
      document.string() + "' 2>'" + log.string() + "' )");
  if (run.exit_code != 0)
    throw std::runtime_error("chromium ended with " + std::to_string(run.exit_code) + ": " +
                             text_of(log));
  return {text_of(document), console_lines(text_of(log))};
}

std::size_t count_of(const std::string& text, const std::string& part) {
  std::size_t count = 0;
  for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1))
    ++count;
  return count;
}

}  // namespace af::test
