// SPDX-License-Identifier: Apache-2.0
#include "files/user_cache.h"

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <string_view>
#include <sys/stat.h>
#include <unistd.h>

#include "base/error.h"
#include "files/output_file.h"
#include "files/sha256.h"

namespace af::user_cache {

namespace fs = std::filesystem;

namespace {

constexpr std::size_t kChecksumDigits = 64;
constexpr std::size_t kMostBytes = 64u << 20;

/// A folder named by the environment. A relative path counts as none, as the XDG Base Directory
/// Specification asks.
fs::path folder_in(const char* variable) {
  const char* const value = std::getenv(variable);
  const fs::path folder = value == nullptr ? "" : value;
  return folder.is_absolute() ? folder : fs::path();
}

fs::path entry_of(const std::string& key) {
  fs::path caches = folder_in("XDG_CACHE_HOME");
  if (caches.empty()) {
    const fs::path home = folder_in("HOME");
    if (home.empty()) throw FileError(key, "neither XDG_CACHE_HOME nor HOME names a folder");
    caches = home / ".cache";
  }
  return caches / "attenuation-fields" / key;
}

/// Nobody else may have written what is read, or may learn from it which CTs there are.
void require_private(const fs::path& folder) {
  struct stat found {};
  constexpr mode_t kOthers = S_IRWXG | S_IRWXO;
  if (::stat(folder.c_str(), &found) != 0 || found.st_uid != ::geteuid() ||
      (found.st_mode & kOthers) != 0)
    throw FileError(folder.string(), "is not this user's alone");
}

/// Checksum of an entry, which shows that it is whole and belongs to this key.
std::string checksum(std::string_view key, std::string_view content) {
  Sha256 hash;
  for (const std::string_view part : {key, content}) hash.update(std::as_bytes(std::span(part)));
  return hash.hex_digest();
}

}  // namespace

std::vector<std::byte> read(const std::string& key) {
  const fs::path path = entry_of(key);
  require_private(path.parent_path());
  const std::string entry = read_own_text_file(path, kMostBytes);
  const std::string_view content =
      std::string_view(entry).substr(std::min(kChecksumDigits, entry.size()));
  if (!entry.starts_with(checksum(key, content))) throw FileError(path.string(), "is damaged");
  const auto bytes = std::as_bytes(std::span(content));
  return {bytes.begin(), bytes.end()};
}

void write(const std::string& key, std::span<const std::byte> bytes) {
  const fs::path path = entry_of(key);
  const std::string_view content(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  const fs::path folder = path.parent_path();
  if (!fs::exists(folder)) {
    make_folder(folder);
    fs::permissions(folder, fs::perms::owner_all);
  }
  require_private(folder);
  write_text_file(path, checksum(key, content).append(content));
}

}  // namespace af::user_cache
