// SPDX-License-Identifier: Apache-2.0
// What the formats of pose files have in common. Every format is a row of pose_formats().
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "geometry/camera_geometry.h"
#include "geometry/rigid_transform.h"
#include "volume/ct_volume.h"

namespace af {

/// What some formats need of the CT and the cameras that the pose is of. Each function is called
/// only by a format that needs it; an empty one means not known, and such a format is refused.
struct PoseContext {
  /// What six numbers (rx_deg ... tz_mm) of a table are relative to.
  std::optional<PoseFrame> frame;
  std::function<CtGrid()> ct_grid = {};
  std::function<CameraRig()> rig = {};
  /// DICOM's Frame of Reference UID of the CT; empty text: the CT has none.
  std::function<std::string()> ct_frame_of_reference = {};
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
  const char* help;  ///< its frames and its direction
  bool (*is_it)(const PoseFileBytes& file);
  PosesInFile (*read)(const PoseFileBytes& file, const PoseContext& context);
  /// nullptr: is read only.
  std::string (*write)(std::span<const RigidTransform> room_from_ct, const PoseContext& context);
};

/// The finite numbers of a text, separated by blanks, commas, semicolons or brackets. FileError
/// that begins with `where` for anything else.
std::vector<double> numbers_of(std::string_view text, const std::string& where);

/// The lines of a text without line ends, blank ones left out.
std::vector<std::string> lines_of(const std::string& text);

/// The one pose to be written; InputError naming the format when there are several or none.
const RigidTransform& only_pose(std::span<const RigidTransform> poses, const char* format);

}  // namespace af
