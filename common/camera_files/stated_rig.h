// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "camera_files/camera_file_options.h"
#include "geometry/camera_geometry.h"

namespace af {

/// A camera as a file states it. What it leaves open holds a placeholder.
struct StatedCamera {
  CameraGeometry geometry;
  bool has_name = false;    ///< otherwise it is named after its file
  bool has_size = true;     ///< otherwise geometry.size_px is (1, 1)
  bool has_spacing = true;  ///< otherwise the detector stands anywhere behind the source
  /// Otherwise geometry states the detector in mm: its origin is the point (0, 0) mm of the
  /// detector and its spacing (1, 1); where the pixels are follows from size, spacing and
  /// --rig-detector-origin-mm.
  bool has_pixel_grid = true;
  bool knows_front = true;  ///< otherwise source and rays may point the wrong way: see turned()
};

/// The cameras of one file.
struct StatedRig {
  std::string file;
  std::optional<Eigen::Vector3d> isocenter_point;
  std::vector<StatedCamera> cameras;
  std::vector<std::string> notes;  ///< how the file was interpreted, for the user
};

/// One rig of the cameras of all files: names, sizes, spacings and the isocentre that the files do
/// not state come from the options or, where that is safe, from a stated default that `warnings`
/// receives. InputError names what is missing and its option, whatever contradicts a file, and
/// problems(CameraRig). \test StatedRig
CameraRig completed_rig(const std::vector<StatedRig>& stated,
                        const CameraFileOptions& options,
                        std::vector<std::string>* warnings);

/// The point with the least sum of squared distances from the rays through the middles of the
/// images; nullopt when they are parallel to 1e-6 or there is only one.
std::optional<Eigen::Vector3d> nearest_point_of_central_rays(
    const std::vector<CameraGeometry>& cameras);

}  // namespace af
