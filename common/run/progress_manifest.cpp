// SPDX-License-Identifier: Apache-2.0
#include "run/progress_manifest.h"

#include <nlohmann/json.hpp>
#include <system_error>
#include <vector>

#include "base/build_info.h"
#include "base/error.h"
#include "files/output_file.h"
#include "files/sha256.h"

namespace af {
std::filesystem::path progress_folder(const std::filesystem::path& output) {
  std::filesystem::path folder = output.lexically_normal();
  if (!folder.has_filename()) folder = folder.parent_path();
  return folder += ".progress";
}

std::string program_build() {
  constexpr std::size_t kDigits = 16;
  static const std::string build = std::string(program_version()) + " build " +
                                   sha256_of_file("/proc/self/exe").substr(0, kDigits);
  return build;
}

DecidingValues deciding_values(DecidingValues options,
                               const std::map<std::string, std::string>& input_sha256) {
  options["program"] = program_build();
  for (const auto& [name, hash] : input_sha256) options["SHA-256 of " + name] = hash;
  return options;
}

bool has_progress_manifest(const std::filesystem::path& path) {
  return std::filesystem::symlink_status(path).type() != std::filesystem::file_type::not_found;
}

void read_progress_manifest(const std::filesystem::path& path,
                            const std::string& format,
                            int version,
                            const std::function<void(const nlohmann::json&)>& take) {
  const auto unusable = [&](const std::string& why) {
    return FileError(path.string(), why + ": start over with --restart");
  };
  constexpr std::uintmax_t kMostBytes = 16u << 20;
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error)) throw unusable("is not a regular file");
  if (std::filesystem::file_size(path, error) > kMostBytes)
    throw unusable("is larger than any such file");
  try {
    const nlohmann::json manifest = nlohmann::json::parse(read_own_text_file(path));
    if (manifest.at("format") != format || manifest.at("format_version") != version)
      throw unusable("is not of the format " + format + " " + std::to_string(version));
    take(manifest);
  } catch (const nlohmann::json::exception& damage) {
    throw unusable(std::string("damaged (") + damage.what() + ")");
  }
}

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
