// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <Eigen/Core>

#include "geometry/camera_geometry.h"

namespace af {

/// A camera as computer vision states it. A room point x (mm) is seen at the pixel (column, row)
/// with (column, row, 1) ~ K (R x + t). The camera's z axis points along the beam. Integers are
/// pixel centres.
struct PinholeCamera {
  Eigen::Matrix3d pixels_from_camera = Eigen::Matrix3d::Identity();  ///< K, K(2, 2) = 1
  Eigen::Matrix3d camera_from_room = Eigen::Matrix3d::Identity();    ///< R
  Eigen::Vector3d translation_mm = Eigen::Vector3d::Zero();          ///< t, in the camera's frame
};

/// The same camera with a detector. K and R fix the source and the rays of all pixels.
/// `column_spacing_mm` fixes how far behind the source the detector stands, and the spacing of rows
/// follows from K. A negative focal length reverses that axis of the detector. Throws InputError,
/// naming `name`, when R is no rotation to 1e-3, or when K has skew, a zero focal length or a last
/// row that is not (0, 0, 1). R is made exactly orthogonal. \test PinholeCamera
CameraGeometry camera_from_pinhole(const std::string& name,
                                   const PinholeCamera& pinhole,
                                   double column_spacing_mm,
                                   const Eigen::Vector2i& size_px);

/// K, R and t of a camera. R is a rotation: a mirrored camera gets a negative focal length along
/// columns instead.
PinholeCamera pinhole_of(const CameraGeometry& camera);

/// K (R | t): maps room points (mm) to pixels.
Eigen::Matrix<double, 3, 4> projection_matrix_of(const CameraGeometry& camera);

/// The same rays, with the detector moved along the beam until columns are `column_spacing_mm`
/// apart.
CameraGeometry with_column_spacing(const CameraGeometry& camera, double column_spacing_mm);

}  // namespace af
