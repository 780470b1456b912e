// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "base/described_fields.h"
#include "image_files/ct_reader.h"

namespace af {

/// Options of af-inspect that write the poses of a file in another format.
struct PoseConversion {
  std::string format;           ///< empty: none is wanted
  std::filesystem::path study;  ///< instead of ct and rig
  std::string study_case;       ///< empty: the only one
  std::filesystem::path ct;
  std::string rig;
  std::string camera;  ///< of the rig or study: DiffDRR's

  void describe(Fields& field);
};

/// The bytes of a file of `options.format` that holds the poses of `path`. What was left out goes
/// to `notes`. InputError and FileError as read_pose_file() and pose_file_bytes().
std::string converted_poses(const std::filesystem::path& path,
                            const PoseConversion& options,
                            const CtReadOptions& ct_reading,
                            std::vector<std::string>& notes);

}  // namespace af
