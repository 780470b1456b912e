// SPDX-License-Identifier: Apache-2.0
// Poses of starts, and poses that any program found from them, in files.
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
  bool is_only_case = true;     ///< a table or file name then need not name the case
  std::set<std::string> cases;  ///< all cases of the study; starts of others are refused
  PoseFrame gold;               ///< for start_rx_deg ... and final_rx_deg ...
  PoseFrame nominal;            ///< for rx_deg ... tz_mm
  PoseContext context = {};     ///< for files of poses that are no tables
};

/// The starts of one case from a CSV file, in its order: rows whose `case` is the case's. The pose
/// is m00 ... m23 of room_from_ct, or start_rx_deg ... start_tz_mm relative to gold. A file of
/// another format of poses (docs/poses.md) holds the starts of the only case. `notes` receives what
/// its reader left out and assumed.
/// Throws FileError when it is unreadable, or a value is not a number. Throws InputError for no row
/// of the case, a row of a case that the study does not have, or a pose that is not rigid. Also
/// when a frame before the file's last pose has none, or when a start_index differs from the row's
/// place among the case's rows: a missing, repeated or misplaced start would renumber the others.
std::vector<RigidTransform> read_starts(const std::filesystem::path& path,
                                        const PoseTableFrames& frames,
                                        std::vector<std::string>& notes);

/// Poses that were found, by start index.
struct FoundPoses {
  std::map<std::int64_t, RigidTransform> room_from_ct;
  std::map<std::int64_t, double> seconds;  ///< where the table has that column
  std::vector<std::string> problems;       ///< what was left out and why, in words
};

/// The poses of one case. A CSV file has start_index, optionally case and seconds, and a pose: m00
/// ... m23 of room_from_ct, or final_rx_deg ... final_tz_mm relative to gold (as in
/// registrations.csv), or rx_deg ... tz_mm relative to the nominal pose, about the ROI centre. A
/// folder has files of one pose each (docs/poses.md), named [CASE-]INDEX.tfm, .json or .toml;
/// foreign ones are refused. In one file of several poses that is no table, the first frame or row
/// is start 0 of the only case, and frames without a pose leave their start without one.
/// Throws InputError for seconds below 0. Reports as problems: a pose with a value that is not
/// finite (no pose), a start that occurs twice (the first counts, even if it is no pose), and a
/// start_index that is not a whole number (no start).
FoundPoses read_found_poses(const std::filesystem::path& path, const PoseTableFrames& frames);

/// Says which cases in a table or folder of poses are not among `known`, so that their omission is
/// noticed. Empty when there are none, and for a table without cases.
std::vector<std::string> unknown_case_problems(const std::filesystem::path& path,
                                               const std::set<std::string>& known);

}  // namespace af::evaluation
