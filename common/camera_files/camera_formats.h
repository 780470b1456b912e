// SPDX-License-Identifier: Apache-2.0
// Formats of camera geometry: one table, told apart by content. docs/cameras.md describes each
// convention; CONTRIBUTING.md says how to add one.
#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "camera_files/camera_file.h"
#include "camera_files/camera_file_options.h"
#include "camera_files/stated_rig.h"
#include "geometry/camera_geometry.h"

namespace af {

/// One format. `write` is given all cameras of a rig, or one of them when a file holds only one.
struct CameraFormat {
  const char* name = nullptr;
  const char* help = nullptr;
  const char* extension = nullptr;
  bool holds_one_camera = false;
  bool (*is_this)(const CameraFile& file) = nullptr;
  StatedRig (*read)(const CameraFile& file, const CameraFileOptions& options) = nullptr;
  std::string (*write)(const CameraRig& rig) = nullptr;  ///< nullptr: is not written
  bool states_distortion = false;
};

/// Every format, in the order in which their marks are looked for.
std::span<const CameraFormat> camera_formats();

std::vector<std::string> readable_camera_formats();
std::vector<std::string> writable_camera_formats();

/// The format recognised from a file's content, or nullptr.
const CameraFormat* recognised_camera_format(const CameraFile& file);

/// Joins the cameras of several files, each of any format, into one rig. FileError when a file is
/// broken or of no known format; InputError for unacceptable or missing values. `warnings` receives
/// the defaults that were assumed.
CameraRig read_camera_files(const std::vector<std::filesystem::path>& files,
                            const CameraFileOptions& options,
                            std::vector<std::string>* warnings);

/// A file's name and bytes.
struct WrittenCameraFile {
  std::filesystem::path path;
  std::string bytes;
};

/// The rig in the named format: one file `path`, or, when the format holds one camera per file and
/// the rig has several, one file per camera, with the camera's name before the extension.
std::vector<WrittenCameraFile> camera_files_of(const CameraRig& rig,
                                               const std::string& format,
                                               const std::filesystem::path& path);

}  // namespace af
