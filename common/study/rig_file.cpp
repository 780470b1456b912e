// SPDX-License-Identifier: Apache-2.0
#include "study/rig_file.h"

#include <algorithm>

#include "base/error.h"
#include "base/joined.h"
#include "camera_files/camera_formats.h"
#include "camera_files/format_readers.h"
#include "files/output_file.h"

namespace af {

namespace fs = std::filesystem;

namespace {

bool is_there(const fs::path& path) {
  std::error_code ignored;
  return fs::status(path, ignored).type() != fs::file_type::not_found;
}

}  // namespace

std::vector<fs::path> rig_files(const std::string& name_or_paths) {
  const std::vector<std::string> shipped = builtin_rig_names();
  if (std::ranges::find(shipped, name_or_paths) != shipped.end()) return {};
  if (is_there(name_or_paths)) return {name_or_paths};
  std::vector<fs::path> files;
  for (std::size_t at = 0; at <= name_or_paths.size();) {
    const std::size_t comma = std::min(name_or_paths.find(',', at), name_or_paths.size());
    if (comma > at) files.emplace_back(name_or_paths.substr(at, comma - at));
    at = comma + 1;
  }
  return files;
}

CameraRig read_rig(const std::string& name_or_paths, std::vector<std::string>* warnings) {
  if (name_or_paths.empty()) throw InputError("rig", "\"\"", "must not be empty");
  const std::vector<fs::path> files = rig_files(name_or_paths);
  if (files.empty()) return parse_rig(builtin_rig_text(name_or_paths), name_or_paths, warnings);
  for (const fs::path& file : files)
    if (!is_there(file))
      throw FileError(file.string(),
                      "no such file, and not a shipped rig (" + joined(builtin_rig_names()) + ")");
  if (files.size() > 1) return read_camera_files(files, {}, warnings);
  // A text of no format is taken for a rig.toml, whose reader says where it goes wrong.
  const CameraFile file = CameraFile::open(files.front());
  const CameraFormat* const format = recognised_camera_format(file);
  if (format != nullptr && format->read != read_rig_toml)
    return read_camera_files(files, {}, warnings);
  // The rest are bytes: a format that cannot be told, or a damaged one.
  if (format == nullptr && file.text.empty() && !file.head.empty() &&
      std::filesystem::file_size(files.front()) <= CameraFile::kMostTextBytes)
    return read_camera_files(files, {}, warnings);
  return parse_rig(
      read_text_file(files.front(), CameraFile::kMostTextBytes), files.front().string(), warnings);
}

}  // namespace af
