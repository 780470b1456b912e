// SPDX-License-Identifier: Apache-2.0
#include "run/deciding_values.h"

#include "base/build_info.h"
#include "files/sha256.h"

namespace af {
namespace {

std::string program_build() {
  constexpr std::size_t kDigits = 16;
  static const std::string build = std::string(program_version()) + " build " +
                                   sha256_of_file("/proc/self/exe").substr(0, kDigits);
  return build;
}

}  // namespace

DecidingValues deciding_values(DecidingValues options,
                               const std::map<std::string, std::string>& input_sha256) {
  options["program"] = program_build();
  for (const auto& [name, hash] : input_sha256) options["SHA-256 of " + name] = hash;
  return options;
}

std::vector<std::string> differences(const DecidingValues& earlier, const DecidingValues& now) {
  std::vector<std::string> found;
  const auto add = [&](const std::string& name, const std::string& value, const std::string& was) {
    found.push_back(name + " = " + value + ": the unfinished work was begun with " + was);
  };
  for (const auto& [name, value] : now) {
    const auto before = earlier.find(name);
    if (before == earlier.end())
      add(name, value, "nothing");
    else if (before->second != value)
      add(name, value, before->second);
  }
  for (const auto& [name, value] : earlier)
    if (!now.contains(name)) add(name, "nothing", value);
  return found;
}

}  // namespace af
