// SPDX-License-Identifier: Apache-2.0
// Cameras and poses. Frames: `ct` (DICOM patient coordinates, LPS, mm), `room` (mm, fixed to the
// X-ray cameras), detector (column, row; integers are pixel centres).
#pragma once

#include <array>
#include <filesystem>
#include <string>
#include <vector>

#include "attenuation_fields/export.h"

namespace attenuation_fields {

using Vector3 = std::array<double, 3>;

/// A rigid map from the CT's frame to the room's, as a 4x4 matrix row by row (mm).
struct Pose {
  std::array<double, 16> room_from_ct = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
};

/// One calibrated X-ray camera, fixed in the room (mm).
struct ATTENUATION_FIELDS_API Camera {
  std::string name;
  Vector3 source_point = {0.0, 0.0, 0.0};
  Vector3 detector_origin_point = {0.0, 0.0, 0.0};      ///< centre of pixel (0, 0)
  Vector3 column_direction = {1.0, 0.0, 0.0};           ///< unit, of increasing column
  Vector3 row_direction = {0.0, 1.0, 0.0};              ///< unit, of increasing row
  std::array<double, 2> pixel_spacing_mm = {1.0, 1.0};  ///< column, row
  std::array<int, 2> size_px = {0, 0};                  ///< columns, rows

  /// The camera of a 3x4 projection matrix (pixels from room mm; row by row). Its sign is chosen so
  /// that `isocenter_point` has positive depth, and the spacing fixes the detector's distance.
  /// Throws InputError when the matrix is singular or has skew, or pixels that do not fit the
  /// spacing.
  static Camera from_projection_matrix(const std::string& name,
                                       const std::array<double, 12>& pixels_from_room,
                                       const std::array<double, 2>& pixel_spacing_mm,
                                       const std::array<int, 2>& size_px,
                                       const Vector3& isocenter_point = {0.0, 0.0, 0.0});

  /// Throws InputError that names every impossible value.
  void require_sound() const;
  /// (column, row) where the ray from the source through a room point meets the detector plane.
  [[nodiscard]] std::array<double, 2> project(const Vector3& room_point) const;
};

/// The cameras of one room.
struct ATTENUATION_FIELDS_API Rig {
  Vector3 isocenter_point = {0.0, 0.0, 0.0};
  std::vector<Camera> cameras;

  /// A rig shipped by name ("c-arm-12in", "treatment-room") or a rig file. `warnings` receives what
  /// is odd about it. Throws InputError and FileError.
  static Rig read(const std::string& name_or_path, std::vector<std::string>* warnings = nullptr);
  /// Throws InputError that names every impossible value, including those of its cameras.
  void require_sound() const;
  /// The text of a rig file that read() reads back to the last bit.
  [[nodiscard]] std::string to_toml() const;
  /// The camera of that name. Throws InputError that lists the known names.
  [[nodiscard]] const Camera& camera(const std::string& name) const;
};

/// The origin of six pose parameters, (R0, c, r) in
///
///     x_room = r + t + Rz(rz) Ry(ry) Rx(rx) R0 (x_ct - c)
///
/// Zero parameters give the nominal pose.
struct ATTENUATION_FIELDS_API PoseFrame {
  std::array<double, 9> rotation = {1, 0, 0, 0, 1, 0, 0, 0, 1};  ///< R0, row by row
  Vector3 center_ct_mm = {0.0, 0.0, 0.0};                        ///< c
  Vector3 center_room_mm = {0.0, 0.0, 0.0};                      ///< r

  /// The frame whose nominal pose is `nominal` and whose rotations are about `center_ct_mm`.
  static PoseFrame about(const Pose& nominal, const Vector3& center_ct_mm);

  /// The pose of rotations about the room's axes (degrees) and translations along them (mm). Throws
  /// InputError when it is not finite or leads out of the world.
  [[nodiscard]] Pose pose(const Vector3& rotation_deg, const Vector3& translation_mm) const;
  /// The six parameters of a pose: rx, ry, rz in degrees, tx, ty, tz in mm.
  [[nodiscard]] std::array<double, 6> parameters(const Pose& pose) const;
};

/// A pose from a file: TOML or JSON with `room_from_ct` (a result.json works), an ITK transform, or
/// 16 numbers. Throws InputError and FileError.
[[nodiscard]] ATTENUATION_FIELDS_API Pose read_pose(const std::filesystem::path& path);

}  // namespace attenuation_fields
