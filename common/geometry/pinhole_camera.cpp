// SPDX-License-Identifier: Apache-2.0
#include "geometry/pinhole_camera.h"

#include <cmath>
#include <sstream>

#include <Eigen/Dense>

#include "base/error.h"

namespace af {

namespace {

std::string one_line(const Eigen::MatrixXd& matrix) {
  std::ostringstream text;
  text << matrix.format(Eigen::IOFormat(
      Eigen::StreamPrecision, Eigen::DontAlignCols, ", ", ", ", "[", "]", "[", "]"));
  return text.str();
}

/// The nearest rotation (singular value decomposition).
Eigen::Matrix3d nearest_rotation(const std::string& field, const Eigen::Matrix3d& matrix) {
  constexpr double kTolerance = 1e-3;
  const Eigen::Matrix3d deviation = matrix * matrix.transpose() - Eigen::Matrix3d::Identity();
  if (!(deviation.cwiseAbs().maxCoeff() < kTolerance) || !(matrix.determinant() > 0.0))
    throw InputError(
        field + "R", one_line(matrix), "must be a rotation: orthonormal rows, determinant +1");
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(matrix, Eigen::ComputeFullU | Eigen::ComputeFullV);
  return svd.matrixU() * svd.matrixV().transpose();
}

void check_intrinsics(const std::string& field, const Eigen::Matrix3d& k) {
  constexpr double kSkewTolerance = 1e-6;
  const auto fail = [&](const char* constraint) {
    throw InputError(field + "K", one_line(k), constraint);
  };
  if (!k.allFinite()) fail("must be finite");
  if (k(1, 0) != 0.0 || k(2, 0) != 0.0 || k(2, 1) != 0.0 || k(2, 2) != 1.0)
    fail("must be [[fx, 0, cx], [0, fy, cy], [0, 0, 1]]");
  constexpr double kSmallestFocalPx = 1e-3;
  if (!(std::abs(k(0, 0)) > kSmallestFocalPx) || !(std::abs(k(1, 1)) > kSmallestFocalPx))
    fail("the focal lengths must not be 0");
  if (!(std::abs(k(0, 1)) <= kSkewTolerance * std::abs(k(0, 0))))
    fail("must have no skew: columns and rows of pixels are orthogonal");
}

}  // namespace

CameraGeometry camera_from_pinhole(const std::string& name,
                                   const PinholeCamera& pinhole,
                                   double column_spacing_mm,
                                   const Eigen::Vector2i& size_px) {
  const std::string field = "camera '" + name + "': ";
  const Eigen::Matrix3d& k = pinhole.pixels_from_camera;
  check_intrinsics(field, k);
  if (!pinhole.translation_mm.allFinite())
    throw InputError(field + "t", one_line(pinhole.translation_mm), "must be finite");
  const Eigen::Matrix3d rotation = nearest_rotation(field, pinhole.camera_from_room);
  const double distance_mm = std::abs(k(0, 0)) * column_spacing_mm;

  CameraGeometry camera;
  camera.name = name;
  camera.size_px = size_px;
  camera.source_point = -rotation.transpose() * pinhole.translation_mm;
  camera.column_direction = std::copysign(1.0, k(0, 0)) * rotation.row(0).transpose();
  camera.row_direction = std::copysign(1.0, k(1, 1)) * rotation.row(1).transpose();
  camera.pixel_spacing_mm = {column_spacing_mm, distance_mm / std::abs(k(1, 1))};
  camera.detector_origin_point = camera.source_point + distance_mm * rotation.row(2).transpose() -
                                 k(0, 2) * camera.pixel_spacing_mm.x() * camera.column_direction -
                                 k(1, 2) * camera.pixel_spacing_mm.y() * camera.row_direction;
  return camera;
}

PinholeCamera pinhole_of(const CameraGeometry& camera) {
  const double sign = camera.is_mirrored() ? -1.0 : 1.0;
  const double distance_mm = camera.source_detector_distance_mm();
  const Eigen::Vector3d to_source = camera.source_point - camera.detector_origin_point;
  PinholeCamera pinhole;
  pinhole.camera_from_room << sign * camera.column_direction.transpose(),
      camera.row_direction.transpose(), camera.beam_direction().transpose();
  pinhole.translation_mm = -pinhole.camera_from_room * camera.source_point;
  pinhole.pixels_from_camera << sign * distance_mm / camera.pixel_spacing_mm.x(), 0.0,
      to_source.dot(camera.column_direction) / camera.pixel_spacing_mm.x(), 0.0,
      distance_mm / camera.pixel_spacing_mm.y(),
      to_source.dot(camera.row_direction) / camera.pixel_spacing_mm.y(), 0.0, 0.0, 1.0;
  return pinhole;
}

Eigen::Matrix<double, 3, 4> projection_matrix_of(const CameraGeometry& camera) {
  const PinholeCamera pinhole = pinhole_of(camera);
  Eigen::Matrix<double, 3, 4> camera_from_room;
  camera_from_room << pinhole.camera_from_room, pinhole.translation_mm;
  return pinhole.pixels_from_camera * camera_from_room;
}

CameraGeometry with_column_spacing(const CameraGeometry& camera, double column_spacing_mm) {
  const double factor = column_spacing_mm / camera.pixel_spacing_mm.x();
  CameraGeometry moved = camera;
  moved.pixel_spacing_mm = factor * camera.pixel_spacing_mm;
  moved.detector_origin_point =
      camera.source_point + factor * (camera.detector_origin_point - camera.source_point);
  return moved;
}

}  // namespace af
