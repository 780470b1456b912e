// SPDX-License-Identifier: Apache-2.0
// Files with other programs' cameras and poses, which af-convert turns into rig.toml, poses and
// study.toml.
#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <string_view>

#include "base/error.h"

namespace af {

/// Whether a file begins with the mark of another program's cameras or poses.
bool has_foreign_mark(std::string_view beginning);

/// "FILES: `what`; a file of another program is converted by: af-convert FILES OPTIONS -o OUTPUT".
InputError needs_conversion(std::span<const std::filesystem::path> files,
                            const std::string& what,
                            const std::string& options,
                            const std::string& output);

/// af-convert's options for the poses of a study's case.
std::string conversion_options(const std::filesystem::path& study, const std::string& case_name);

}  // namespace af
