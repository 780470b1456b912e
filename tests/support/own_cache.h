// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdlib>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <sys/stat.h>

#include "support/test_paths.h"

namespace af::test {

/// Gives this process, and those that it starts, their own user's cache, which is empty at first.
class OwnCache {
 public:
  OwnCache() { use(scratch_.path()); }
  ~OwnCache() {
    if (before_)
      setenv(kVariable, before_->c_str(), 1);
    else
      unsetenv(kVariable);
  }
  OwnCache(const OwnCache&) = delete;
  OwnCache& operator=(const OwnCache&) = delete;

  /// Another folder, which need not exist.
  static void use(const std::filesystem::path& folder) { setenv(kVariable, folder.c_str(), 1); }

  [[nodiscard]] std::filesystem::path folder() const { return scratch_ / "attenuation-fields"; }

  /// Entries by name, each with its inode number, which changes when an entry is written anew.
  [[nodiscard]] std::map<std::string, ino_t> entries() const {
    std::map<std::string, ino_t> found;
    if (!std::filesystem::exists(folder())) return found;
    for (const auto& entry : std::filesystem::directory_iterator(folder())) {
      struct stat status {};
      stat(entry.path().c_str(), &status);
      found[entry.path().filename().string()] = status.st_ino;
    }
    return found;
  }

 private:
  static constexpr const char* kVariable = "XDG_CACHE_HOME";

  static std::optional<std::string> value() {
    const char* const text = std::getenv(kVariable);
    return text == nullptr ? std::nullopt : std::optional<std::string>(text);
  }

  ScratchFolder scratch_;
  std::optional<std::string> before_ = value();
};

}  // namespace af::test
