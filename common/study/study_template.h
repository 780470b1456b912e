// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

namespace af {

/// What template_text() knows: study, rig, scan.
std::vector<std::string> template_names();

/// A file to fill in, with a comment for every key. It is valid as it is, and with its optional
/// keys uncommented. Throws InputError for an unknown name. \test
/// StudyFile.TemplateIsAValidStudyWithAndWithoutItsOptionalKeys
std::string template_text(const std::string& name);

}  // namespace af
