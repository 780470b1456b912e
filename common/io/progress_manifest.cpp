// SPDX-License-Identifier: Apache-2.0
#include "io/progress_manifest.h"

#include <vector>

#include "base/error.h"

namespace af {

void require_same(const DecidingValues& earlier,
                  const DecidingValues& now,
                  const std::filesystem::path& folder) {
  std::vector<std::string> differences;
  for (const auto& [name, value] : now) {
    const auto found = earlier.find(name);
    const std::string before = found == earlier.end() ? "nothing" : found->second;
    if (before != value)
      differences.push_back(std::string(name)
                                .append(" = ")
                                .append(value)
                                .append(": the unfinished work was begun with ")
                                .append(before));
  }
  for (const auto& [name, value] : earlier)
    if (!now.contains(name))
      differences.push_back(std::string(name)
                                .append(" = nothing: the unfinished work was begun with ")
                                .append(value));
  if (differences.empty()) return;
  differences.emplace_back(
      "repeat the earlier options to go on with it, or give --restart to throw it away");
  throw_if_any(differences, folder.string());
}

}  // namespace af
