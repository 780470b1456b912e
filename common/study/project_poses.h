// SPDX-License-Identifier: Apache-2.0
// The project's own ways of writing a pose: room_from_ct as JSON, TOML and CSV.
#pragma once

#include "study/pose_format.h"

namespace af {

bool is_json_pose(const PoseFileBytes& file);
PosesInFile read_json_pose(const PoseFileBytes& file, const PoseContext& context);

bool is_toml_pose(const PoseFileBytes& file);
PosesInFile read_toml_pose(const PoseFileBytes& file, const PoseContext& context);

bool is_csv_of_poses(const PoseFileBytes& file);
PosesInFile read_csv_of_poses(const PoseFileBytes& file, const PoseContext& context);

}  // namespace af
