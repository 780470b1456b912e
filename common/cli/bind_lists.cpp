// SPDX-License-Identifier: Apache-2.0
#include "cli/bind_lists.h"

#include <vector>

#include <CLI/CLI.hpp>

namespace af::cli {

void bind_lists(CLI::App& app, const std::map<std::string, std::string>& lists) {
  std::vector<std::string> names;
  names.reserve(lists.size());
  for (const auto& [name, text] : lists) names.push_back(name);
  app.add_option_function<std::string>(
         "--list",
         // CLI11 prints the text of this "error" and ends the line, on one rank, with exit code 0.
         [lists](const std::string& name) {
           const std::string& text = lists.at(name);
           throw CLI::CallForVersion(text.substr(0, text.find_last_not_of('\n') + 1), 0);
         },
         "Print the names to choose from, one per line, with tabs between columns, and exit")
      ->check(CLI::IsMember(names))
      ->trigger_on_parse();
}

}  // namespace af::cli
