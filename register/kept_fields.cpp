// SPDX-License-Identifier: Apache-2.0
#include "register/kept_fields.h"

namespace af::registration {
namespace {

std::set<std::string> field_paths(const StudyCase& study_case) {
  std::set<std::string> paths;
  for (const StudyView& view : study_case.views)
    if (view.field.has_value()) paths.insert(view.field->string());
  return paths;
}

}  // namespace

KeptFields::KeptFields(std::span<const StudyCase> cases) {
  for (const StudyCase& study_case : cases)
    for (const std::string& path : field_paths(study_case)) ++cases_left_[path];
}

void KeptFields::begin_case(const StudyCase& study_case) {
  const std::set<std::string> used = field_paths(study_case);
  for (const std::string& path : used) --cases_left_[path];
  std::erase_if(fields_, [&](const auto& kept) { return used.count(kept.first) == 0; });
}

std::shared_ptr<const OpenedField> KeptFields::find(const std::string& path) const {
  const auto found = fields_.find(path);
  return found == fields_.end() ? nullptr : found->second;
}

void KeptFields::add(const std::string& path, const std::shared_ptr<const OpenedField>& field) {
  const auto left = cases_left_.find(path);
  const bool is_used_later = left != cases_left_.end() && left->second > 0;
  if (is_used_later)
    fields_[path] = field;
  else
    fields_.erase(path);
}

}  // namespace af::registration
