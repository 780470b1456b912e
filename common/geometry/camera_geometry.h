// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <string>
#include <tuple>
#include <vector>

#include <Eigen/Core>

#include "geometry/lens_distortion.h"

namespace af {

/// Half-line from the X-ray source.
struct Ray {
  Eigen::Vector3d origin_point;
  Eigen::Vector3d direction;  ///< unit
};

/// One calibrated X-ray camera, fixed in the room (mm). Detector coordinates are (column, row);
/// integers are pixel centres, so the detector's outer edges are at -0.5 and size - 0.5.
struct CameraGeometry {
  std::string name;
  Eigen::Vector3d source_point = Eigen::Vector3d::Zero();
  Eigen::Vector3d detector_origin_point = Eigen::Vector3d::Zero();  ///< centre of pixel (0, 0)
  Eigen::Vector3d column_direction = Eigen::Vector3d::UnitX();      ///< of increasing column
  Eigen::Vector3d row_direction = Eigen::Vector3d::UnitY();         ///< of increasing row
  Eigen::Vector2d pixel_spacing_mm = Eigen::Vector2d::Ones();       ///< column, row
  Eigen::Vector2i size_px = Eigen::Vector2i::Zero();                ///< columns, rows
  /// The lens that distorted the stored X-rays. Reading undistorts them, so everything else here
  /// describes undistorted images.
  LensDistortion distortion;

  auto members() {
    return std::tie(name,
                    source_point,
                    detector_origin_point,
                    column_direction,
                    row_direction,
                    pixel_spacing_mm,
                    size_px,
                    distortion);
  }

  [[nodiscard]] Eigen::Vector3d detector_point(double column, double row) const;
  [[nodiscard]] Ray ray(double column, double row) const;
  /// (column, row) where the ray from the source through a room point meets the detector plane. The
  /// point must lie on the detector's side of the source.
  [[nodiscard]] Eigen::Vector2d project(const Eigen::Vector3d& room_point) const;
  /// Unit normal of the detector plane that points from source to detector.
  [[nodiscard]] Eigen::Vector3d beam_direction() const;
  /// Distance from the source to the detector plane.
  [[nodiscard]] double source_detector_distance_mm() const;
  /// Distance from the source to the plane through `room_point` parallel to the detector.
  [[nodiscard]] double depth_mm(const Eigen::Vector3d& room_point) const;
  /// Detector pixels per millimetre on the plane through `room_point` parallel to the detector
  /// (mean spacing of columns and rows).
  [[nodiscard]] double pixels_per_mm(const Eigen::Vector3d& room_point) const;
  /// True when column x row points against the beam. Images then appear mirrored.
  [[nodiscard]] bool is_mirrored() const;
  /// The four outer corners of the detector (room, mm).
  [[nodiscard]] std::array<Eigen::Vector3d, 4> detector_corner_points() const;

  /// The camera of a 3x4 projection matrix (pixels from room mm). Its overall sign is chosen so
  /// that `isocenter_point` has positive depth. The matrix fixes the source and the pixel rays;
  /// `pixel_spacing_mm` fixes the detector distance. Throws InputError when the matrix is singular,
  /// has skew beyond 1e-6 of its focal length, or pixels that are not rectangular at the stated
  /// spacing.
  static CameraGeometry from_projection_matrix(const std::string& name,
                                               const Eigen::Matrix<double, 3, 4>& pixels_from_room,
                                               const Eigen::Vector2d& pixel_spacing_mm,
                                               const Eigen::Vector2i& size_px,
                                               const Eigen::Vector3d& isocenter_point);
};

/// Every broken constraint, each naming the camera, the key, its value and the constraint.
std::vector<std::string> problems(const CameraGeometry& camera);

/// The cameras of one room.
struct CameraRig {
  Eigen::Vector3d isocenter_point = Eigen::Vector3d::Zero();
  std::vector<CameraGeometry> cameras;

  auto members() { return std::tie(isocenter_point, cameras); }

  /// The camera of that name, or the only one whose name differs just in upper and lower case.
  /// Throws InputError that lists the known names.
  [[nodiscard]] const CameraGeometry& camera(const std::string& name) const;
};

std::vector<std::string> problems(const CameraRig& rig);

}  // namespace af
