// SPDX-License-Identifier: Apache-2.0
// Reads and writes poses of a CT in the room, in the formats of docs/poses.md.
#pragma once

#include <array>
#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <span>
#include <string>
#include <vector>

#include "geometry/rigid_transform.h"
#include "study/pose_format.h"

namespace af {

/// The format of a file that holds poses, by its content. For a file of another program, throws
/// InputError with the command that converts it.
const PoseFormat& format_of_pose_file(const PoseFileBytes& file, const PoseContext& context = {});

/// A pose file in memory. Throws FileError when it is unreadable, empty or larger than 64 MiB.
PoseFileBytes read_pose_bytes(const std::filesystem::path& path);

/// All poses of a file. Throws InputError when one is not rigid or `context` lacks what the format
/// needs, FileError when it is damaged.
PosesInFile read_pose_file(const std::filesystem::path& path, const PoseContext& context = {});

/// The poses of a file, at least one. `notes`, if given, receives what was left out and assumed.
std::vector<RigidTransform> read_poses(const std::filesystem::path& path,
                                       const PoseContext& context,
                                       std::vector<std::string>* notes = nullptr);

/// read_poses() for lists, such as starts, in which a pose's place must be the number of its row or
/// frame. InputError names the first row or frame without a pose, if a later one has a pose.
std::vector<RigidTransform> read_unbroken_poses(const std::filesystem::path& path,
                                                const PoseContext& context,
                                                std::vector<std::string>* notes = nullptr);

/// The only pose of a file. Throws InputError when it holds several.
RigidTransform read_pose(const std::filesystem::path& path,
                         const PoseContext& context = {},
                         std::vector<std::string>* notes = nullptr);

/// A pose as the rows of its matrix, as result.json and summaries hold it, and back. Throws
/// InputError that begins with `where` when these are not four rows of four numbers, or not rigid.
nlohmann::json pose_rows(const RigidTransform& pose);
RigidTransform pose_of_rows(const nlohmann::json& rows, const std::string& where);

/// TOML text with room_from_ct as 4x4, 17 significant digits.
std::string pose_to_toml(const RigidTransform& room_from_ct);

/// ITK text transform (AffineTransform_double_3_3) that holds ct_from_room in LPS mm. This is the
/// resampling direction: Slicer, applying it to the CT, shows the CT in the room.
std::string pose_to_itk_transform(const RigidTransform& room_from_ct);

}  // namespace af
