// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

namespace af {

/// What template_text() knows: study, rig, scan.
std::vector<std::string> template_names();

/// A file to fill in, every key with a comment: valid as it is, and with its optional keys
/// uncommented. InputError for an unknown name. \test
/// StudyFile.TemplateIsAValidStudyWithAndWithoutItsOptionalKeys
std::string template_text(const std::string& name);

}  // namespace af
