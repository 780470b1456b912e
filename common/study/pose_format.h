// SPDX-License-Identifier: Apache-2.0
// What the formats of pose files have in common. Every format is a row of pose_formats().
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "geometry/rigid_transform.h"

namespace af {

/// What the poses of a file belong to.
struct PoseContext {
  /// What six numbers (rx_deg ... tz_mm) of a table are relative to.
  std::optional<PoseFrame> frame;
  /// Options of af-convert, for files of other programs: "--study STUDY --case CASE", or "--ct CT".
  std::string conversion_options = {};
};

/// A pose file, read into memory.
struct PoseFileBytes {
  std::filesystem::path path;
  std::string bytes;
};

/// What a pose file holds.
struct PosesInFile {
  struct Numbered {
    std::int64_t number = 1;  ///< of its row or frame in the file, counted from 1
    RigidTransform room_from_ct = RigidTransform::Identity();
  };
  std::vector<Numbered> poses;
  std::vector<std::string> notes;  ///< what was left out, and what was assumed
};

struct PoseFormat {
  const char* name;
  bool (*is_it)(const PoseFileBytes& file);
  PosesInFile (*read)(const PoseFileBytes& file, const PoseContext& context);
};

/// The finite numbers of a text, separated by blanks, commas, semicolons or brackets. Throws
/// FileError that begins with `where` for anything else.
std::vector<double> numbers_of(std::string_view text, const std::string& where);

/// The lines of a text without line ends, blank ones left out.
std::vector<std::string> lines_of(const std::string& text);

}  // namespace af
