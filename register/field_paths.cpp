// SPDX-License-Identifier: Apache-2.0
#include "register/field_paths.h"

#include <optional>
#include <set>
#include <utility>

namespace af::registration {
namespace {

/// CAMERA and PATH of "CAMERA=PATH"; nullopt when it is not of that form.
std::optional<std::pair<std::string, std::string>> split_field(const std::string& text) {
  const std::size_t equals = text.find('=');
  if (equals == std::string::npos || equals == 0 || equals + 1 == text.size()) return std::nullopt;
  return std::pair(text.substr(0, equals), text.substr(equals + 1));
}

}  // namespace

void FieldPaths::describe(Fields& field) {
  field("field", texts, "CAMERA=FIELD.h5, once per camera; replaces the study's `field`").input();
}

std::map<std::string, std::filesystem::path> FieldPaths::by_camera() const {
  std::map<std::string, std::filesystem::path> paths;
  for (const std::string& text : texts)
    if (const auto field = split_field(text); field.has_value())
      paths[field->first] = field->second;
  return paths;
}

std::vector<std::string> problems(const FieldPaths& fields) {
  std::vector<std::string> found;
  std::set<std::string> cameras;
  for (const std::string& text : fields.texts) {
    const auto field = split_field(text);
    if (!field.has_value())
      found.push_back("--field = '" + text + "': must be CAMERA=PATH");
    else if (!cameras.insert(field->first).second)
      found.push_back("--field = '" + text + "': camera '" + field->first + "' is given twice");
  }
  return found;
}

}  // namespace af::registration
