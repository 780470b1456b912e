// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>

namespace af::test {

/// A page as a browser has it after its scripts have run.
struct BrowserPage {
  std::string document;  ///< serialized DOM
  std::string console;   ///< what the page and its scripts had to complain about; empty: nothing
};

/// Whether a browser is installed (chromium).
bool has_browser();

/// Opens a file in headless Chromium without a network. `scratch` is a folder for the browser.
BrowserPage open_in_browser(const std::filesystem::path& page,
                            const std::filesystem::path& scratch);

/// How often `part` occurs.
std::size_t count_of(const std::string& text, const std::string& part);

}  // namespace af::test
