// SPDX-License-Identifier: Apache-2.0
// Poses of starts, and poses that any program found from them, as files.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "geometry/rigid_transform.h"
#include "study/pose_format.h"

namespace af::evaluation {

/// What the columns of a table of poses are relative to.
struct PoseTableFrames {
  std::string case_name;
  bool is_only_case = true;     ///< a table or file name need not name the case
  std::set<std::string> cases;  ///< all of the study; starts of others are refused
  PoseFrame gold;               ///< of start_rx_deg ... and final_rx_deg ...
  PoseFrame nominal;            ///< of rx_deg ... tz_mm
  PoseContext context = {};     ///< of files of poses that are no tables
};

/// The starts of one case from a CSV file, in its order: rows whose `case` is the case's; the pose
/// is m00 ... m23 of room_from_ct, or start_rx_deg ... start_tz_mm relative to gold. FileError:
/// unreadable, or a value that is not a number; InputError: no row of the case, a row of a case
/// that the study does not have, a pose that is not rigid, or a start_index (if there is that
/// column) that differs from the row's place among the case's rows: a start that is missing,
/// repeated or out of order would renumber the others. A file of another format of poses
/// (docs/poses.md) holds the starts of the only case; InputError when a frame before its last pose
/// has none. `notes` get what its reader left out and assumed.
std::vector<RigidTransform> read_starts(const std::filesystem::path& path,
                                        const PoseTableFrames& frames,
                                        std::vector<std::string>& notes);

/// Poses that were found, by start index.
struct FoundPoses {
  std::map<std::int64_t, RigidTransform> room_from_ct;
  std::map<std::int64_t, double> seconds;  ///< where the table has that column
  std::vector<std::string> problems;       ///< what was left out and why, in words
};

/// The poses of one case: a CSV file with start_index, optionally case and seconds, and m00 ... m23
/// of room_from_ct, or final_rx_deg ... final_tz_mm relative to gold (as in registrations.csv), or
/// rx_deg ... tz_mm relative to the nominal pose, about the ROI centre. Or a folder of files of one
/// pose each (docs/poses.md), named [CASE-]INDEX.tfm, .json or .toml; foreign ones are refused. Or
/// one file of several poses that is no table: its first frame or row is start 0 of the only case,
/// and frames without a pose leave their start without one. InputError for seconds below 0.
/// Reported as problems: a pose with a value that is not finite (no pose), a start that occurs
/// twice (the first counts, even if it is no pose) and a start_index that is not a whole number (no
/// start).
FoundPoses read_found_poses(const std::filesystem::path& path, const PoseTableFrames& frames);

/// Says which cases in a table or folder of poses are not among `known`, so that their omission is
/// noticed. Empty when there are none, and for a table without cases.
std::vector<std::string> unknown_case_problems(const std::filesystem::path& path,
                                               const std::set<std::string>& known);

}  // namespace af::evaluation
