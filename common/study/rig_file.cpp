// SPDX-License-Identifier: Apache-2.0
#include "study/rig_file.h"

#include <algorithm>

#include "base/error.h"
#include "base/joined.h"
#include "files/foreign_file.h"
#include "files/output_file.h"
#include "study/matrix_text.h"

namespace af {

namespace fs = std::filesystem;

namespace {

bool is_there(const fs::path& path) {
  std::error_code ignored;
  return fs::status(path, ignored).type() != fs::file_type::not_found;
}

/// A damaged rig.toml counts as one, because its reader says where it goes wrong.
bool is_rig_toml(const fs::path& path, const std::string& text) {
  return !has_foreign_mark(text) &&
         (path.extension() == ".toml" || text.find("[[camera]]") != std::string::npos);
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
  if (files.size() > 1)
    throw needs_conversion(files, "a rig is one file, a rig.toml", "", "rig.toml");
  constexpr std::size_t kMostBytes = std::size_t{64} << 20;
  const fs::path& file = files.front();
  const std::string text = read_text_file(file, kMostBytes);
  if (is_rig_toml(file, text)) return parse_rig(text, file.string(), warnings);
  if (!is_matrix_text(text))
    throw needs_conversion(files, "is neither a rig.toml nor projection matrices", "", "rig.toml");
  const std::string toml = rig_toml_of_matrices(text);
  if (toml.empty())
    throw needs_conversion(files,
                           "its comments do not state '# isocenter_point X Y Z' and, before each "
                           "matrix, '# camera NAME', '# size_px COLUMNS ROWS' and "
                           "'# pixel_spacing_mm COLUMN ROW'",
                           "",
                           "rig.toml");
  return parse_rig(toml, file.string(), warnings);
}

}  // namespace af
