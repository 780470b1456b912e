// SPDX-License-Identifier: Apache-2.0
// The rig that an option or a study names: a shipped one, a rig.toml, or matrices as text.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "geometry/camera_geometry.h"
#include "study/rig_toml.h"

namespace af {

/// Reads a rig by shipped name or from a file. Throws InputError (exit 3) for a bad rig, naming
/// file, line, camera, key, value and constraint, and for files of another program, with the
/// command that converts them. Throws FileError (exit 4) when unreadable. `warnings` receives e.g.
/// "camera 'A': mirrored ...".
CameraRig read_rig(const std::string& name_or_paths, std::vector<std::string>* warnings = nullptr);

/// The comma-separated files that a rig's name stands for; empty for a shipped rig.
std::vector<std::filesystem::path> rig_files(const std::string& name_or_paths);

}  // namespace af
