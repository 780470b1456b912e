// SPDX-License-Identifier: Apache-2.0
// The project's own ways to write a pose: room_from_ct as JSON, TOML, plain numbers and CSV.
#pragma once

#include "pose_files/pose_format.h"

namespace af {

bool is_json_pose(const PoseFileBytes& file);
PosesInFile read_json_pose(const PoseFileBytes& file, const PoseContext& context);

bool is_toml_pose(const PoseFileBytes& file);
PosesInFile read_toml_pose(const PoseFileBytes& file, const PoseContext& context);
std::string write_toml_pose(std::span<const RigidTransform> room_from_ct,
                            const PoseContext& context);

/// Any text: what is no pose is refused by reading.
bool is_plain_pose(const PoseFileBytes& file);
PosesInFile read_plain_pose(const PoseFileBytes& file, const PoseContext& context);
std::string write_plain_pose(std::span<const RigidTransform> room_from_ct,
                             const PoseContext& context);

bool is_csv_of_poses(const PoseFileBytes& file);
PosesInFile read_csv_of_poses(const PoseFileBytes& file, const PoseContext& context);
std::string write_csv_of_poses(std::span<const RigidTransform> room_from_ct,
                               const PoseContext& context);

}  // namespace af
