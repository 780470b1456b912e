// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "geometry/camera_geometry.h"

namespace af {

/// Rigs shipped by name: "c-arm-12in" (cameras AP, LAT) and "treatment-room" (cameras A, B).
std::vector<std::string> builtin_rig_names();

/// TOML text of a shipped rig.
std::string builtin_rig_text(const std::string& name);

/// A rig from its TOML text; messages name `file`. Throws InputError (exit 3) for a bad rig, naming
/// file, line, camera, key, value and constraint, FileError (exit 4) when it is not TOML.
/// `warnings` receives e.g. "camera 'A': mirrored ...".
CameraRig parse_rig(const std::string& text,
                    const std::string& file,
                    std::vector<std::string>* warnings = nullptr);

/// The rig as TOML text that parse_rig() reads back to the last bit.
std::string rig_to_toml(const CameraRig& rig);

/// Axes within the tolerance of problems() are made exactly unit and orthogonal, so that projecting
/// and casting agree. Axes that already are keep their bits.
void clean_axes(CameraGeometry& camera);

/// The rule for a camera name that it breaks, so that it can be part of options (--field NAME=PATH)
/// and of file names. Empty when it breaks none.
std::string camera_name_problem(const std::string& name);

}  // namespace af
