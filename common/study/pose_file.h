// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "geometry/rigid_transform.h"

namespace af {

/// Reads a pose room_from_ct from a file: JSON or TOML with a 4x4 `room_from_ct` (a result.json
/// works), an ITK transform
/// (.tfm, holding ct_from_room), or plain text with 16 numbers row by row. InputError when it is
/// not rigid, FileError when unreadable.
RigidTransform read_pose(const std::filesystem::path& path);

/// A pose as the rows of its matrix, as result.json and summaries hold it, and back: InputError
/// that begins with `where` when these are not four rows of four numbers, or not rigid.
nlohmann::json pose_rows(const RigidTransform& pose);
RigidTransform pose_of_rows(const nlohmann::json& rows, const std::string& where);

/// The pose of six numbers (rx_deg ... tz_mm) relative to `frame`. InputError, beginning with
/// `where`, when it is not finite or leads out of the world (rigidity_problems()).
RigidTransform pose_of_deg_and_mm(const PoseFrame& frame,
                                  const std::array<double, 6>& values,
                                  const std::string& where);

/// TOML text with room_from_ct as 4x4, 17 significant digits.
std::string pose_to_toml(const RigidTransform& room_from_ct);

/// ITK text transform (AffineTransform_double_3_3) holding ct_from_room in LPS mm: the resampling
/// direction, so that Slicer, applied to the CT, shows it in the room.
std::string pose_to_itk_transform(const RigidTransform& room_from_ct);

/// Poses of a CSV file with a header: columns rx_deg, ry_deg, rz_deg, tx_mm, ty_mm, tz_mm relative
/// to `frame`, or m00 ... m23 (or m33) of room_from_ct. Errors name file, line, column, value.
std::vector<RigidTransform> read_poses_csv(const std::filesystem::path& path,
                                           const PoseFrame& frame);

}  // namespace af
